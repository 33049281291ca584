#pragma once

#include <string>

namespace abs_hil::experiment {

/// Options under `experiment.` in the configuration.
struct ExperimentOptions {
  std::string name{"paper"};
  bool wait_for_start{false};       ///< stay idle until a command gives the start
  double start_speed_rad_s{0.0};    ///< > 0: start braking at once from this speed of both wheels (simulation only)
  double end_speed_m_s{0.3};        ///< car speed at which braking counts as done, > 0
  std::string cut{"threshold"};     ///< what cuts the motor: "threshold" or "peak" of the upper wheel's speed
  double cut_speed_rad_s{170.0};    ///< upper wheel's speed at which the motor is cut ("threshold"), > 0
  double peak_wait_s{0.3};          ///< no new maximum for this long is a peak ("peak"), > 0
  double motor_duty{1.0};           ///< drive PWM while accelerating, in (0, 1]
  double idle_s{0.05};              ///< still, before the motor starts, >= 0
  double coast_s{0.01};             ///< motor off, brake not yet on, >= 0
  double hold_torque_Nm{2.0};       ///< brake torque from the end of slip control to standstill; 0 lets the rig run out
  double stopped_s{0.1};            ///< recorded after standstill, >= 0
  double accelerate_limit_s{20.0};  ///< time limits: a phase that lasts longer is a fault, > 0
  double brake_limit_s{30.0};
  double hold_limit_s{30.0};
  double stop_brake_duty{0.0};     ///< brake PWM after a stop request, until standstill, in [0, 1]; 0: released at once
  double stop_brake_limit_s{5.0};  ///< ... but no longer than this, > 0
};

}  // namespace abs_hil::experiment
