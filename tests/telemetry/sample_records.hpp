#pragma once

#include <cstdint>

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::telemetry::test {

/// A record of a 1 kHz run in which every field has a value of its own.
inline rig::CycleRecord sample_record(std::uint64_t sequence) {
  const double x = static_cast<double>(sequence) / 3.0;  // no short decimal
  rig::CycleRecord r;
  r.sequence = sequence;
  r.stamp_ns = 1'000'000'000 + static_cast<std::int64_t>(sequence) * 1'000'000;
  r.time_s = static_cast<double>(sequence) / 1000.0;
  r.phase = rig::Phase::brake;
  r.measurement.time_ns = r.stamp_ns;
  r.sample_time_s = 0.61 + x;
  r.measurement.upper_counts = 1000 + static_cast<std::int32_t>(sequence);
  r.measurement.lower_counts = -2000 - static_cast<std::int32_t>(sequence);
  r.measurement.supply_V = 24.0 + x;
  r.measurement.temperature_C = 31.0 + x;
  r.measurement.trip_flags = 5;
  r.control.speeds_est = {11.0 + x, 12.0 + x};
  r.control.slip_est = 0.21 + x;
  r.control.slip_ref = 0.22 + x;
  r.control.slip_velocity_error_m_s = 0.23 + x;
  r.control.brake_torque_ref_Nm = 3.1 + x;
  r.control.brake_torque_est_Nm = 3.2 + x;
  r.control.theta_est_N = 22.0 + x;
  r.command = {0.41 + x, 0.51 + x, true, 3.3};
  r.truth.speeds = {13.0 + x, 14.0 + x};
  r.truth.slip = 0.24 + x;
  r.truth.brake_torque_Nm = 3.4 + x;
  r.truth.theta_N = 23.0 + x;
  r.timing = {101, 102, 103, 104, 105, 2};
  return r;
}

}  // namespace abs_hil::telemetry::test
