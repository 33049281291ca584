// The parts of a run in lanes that do not depend on its plant.
#pragma once

#include <cstdint>
#include <memory>

#include "config/plan.hpp"
#include "config/settings.hpp"
#include "study/lanes/braking_run.hpp"
#include "study/lanes/lane_jobs.hpp"

namespace abs_hil::study::lanes {

/// The parts of a run that do not depend on its plant.
struct LaneSettings::Parts {
  const config::Settings& settings;
  std::unique_ptr<control::SlipController> controller{};
  LaneSequence<double> sequence{};
  control::SpeedTracker<double> tracker{};
  control::BrakeActuator actuator{};
  std::int64_t period_ns{0};
  double period_s{0.0};
  double duty_steps{0.0};
  std::uint32_t window_cycles{1};
};

/// The phases that lanes know: slip control until the car is slow, then at most a constant torque until standstill.
/// False for others.
bool plan_sequence(const config::Plan& plan, const config::Settings& settings, LaneSequence<double>& sequence);

/// Cycles of the gate's speed windows; 0 if its checks would not judge often enough.
std::uint32_t cycles_of_window(const LaneSettings::Parts& parts, std::int32_t counts_per_rev);

/// The checks of the gate, for the rig with this identity.
/// @param cycles  of its speed windows
LaneGate<double> plan_gate(const LaneSettings::Parts& parts, const rig::RigParameters& identity, std::uint32_t cycles);

}  // namespace abs_hil::study::lanes
