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
  LaneGate<double> gate{};
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

/// The checks of the gate; false if they would not judge often enough.
bool plan_gate(LaneSettings::Parts& parts);

}  // namespace abs_hil::study::lanes
