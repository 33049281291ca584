#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "watch/run_view.hpp"

namespace abs_hil::watch::test {

inline constexpr std::int64_t ms = 1'000'000;

/// Message n of a 1 kHz run.
inline telemetry_t telemetry(std::int64_t sequence) {
  telemetry_t m{};
  m.sequence = m.cycle = sequence;
  m.stamp_ns = sequence * ms;
  m.time_s = static_cast<double>(sequence) / 1000.0;
  m.phase = telemetry_t::PHASE_BRAKE;
  m.omega1_rad_s = 80.0;
  m.omega2_rad_s = 100.0;
  m.slip = 0.21;
  m.slip_ref = 0.2;
  m.theta_est_N = 22.5;
  m.theta_N = 23.0;
  return m;
}

inline status_t status(std::int64_t sequence) {
  status_t m{};
  m.sequence = sequence;
  m.realtime = 1;
  m.wakeup_latency_p50_us = 11.0;
  m.wakeup_latency_p99_us = 12.0;
  m.wakeup_latency_p99_9_us = 13.0;
  m.wakeup_latency_max_us = 14.0;
  m.cycle_time_p50_us = m.cycle_time_p99_us = m.cycle_time_p99_9_us = m.cycle_time_max_us = 15.0;
  return m;
}

inline event_t event(std::int64_t sequence, std::string kind, std::string message) {
  event_t m{};
  m.sequence = sequence;
  m.kind = std::move(kind);
  m.message = std::move(message);
  return m;
}

inline experiment_t experiment(std::int64_t sequence) {
  experiment_t m{};
  m.sequence = sequence;
  m.experiment = "paper";
  m.controller = "adaptive";
  m.plant = "paper-table1";
  m.backend = "sim";
  return m;
}

/// The same with signals of the controller.
inline telemetry_t with_signals(std::int64_t sequence) {
  telemetry_t m = telemetry(sequence);
  m.names = "I_m,zeta_N";
  m.values = {0.125, 15.5};
  m.value_count = 2;
  return m;
}

/// Messages `from` to `to` - 1, each arriving when it was sent.
inline void feed(RunView& view, std::int64_t from, std::int64_t to) {
  for (std::int64_t i = from; i < to; ++i) view.take(telemetry(i), i * ms);
}

}  // namespace abs_hil::watch::test
