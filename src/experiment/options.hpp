#pragma once

#include <string>

#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::experiment {

/// Values of experiment.answers beside auto.
inline constexpr const char* answers_person = "person";
inline constexpr const char* answers_itself = "itself";

/// Options under `experiment.` in the configuration.
struct ExperimentOptions {
  ABS_HIL_OPTIONS(ExperimentOptions);
  ABS_HIL_OPTION(std::string, name, "paper", .meaning = "experiment by name or TOML file",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, start_speed_rad_s, 0.0, .unit = "rad/s",
                 .meaning = "simulation: brake at once from this speed; 0: accelerate first",
                 .range = rig::from_zero(1000), .safety = rig::judged_elsewhere);
  ABS_HIL_OPTION(double, end_speed_m_s, 0.3, .unit = "m/s", .meaning = "car speed at which braking counts as done",
                 .range = rig::between(0.02, 50), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, cut, "threshold", .meaning = "what cuts the motor", .allowed = {"threshold", "peak"},
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, cut_speed_rad_s, 170.0, .unit = "rad/s", .meaning = "upper wheel's speed that cuts the motor",
                 .range = rig::positive(1000), .safety = rig::weaker_above(250));
  ABS_HIL_OPTION(double, peak_wait_s, 0.3, .unit = "s", .meaning = "time without a new maximum that counts as a peak",
                 .range = rig::between(0.05, 10), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, motor_duty, 1.0, .meaning = "drive PWM while accelerating", .range = rig::positive(1),
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, idle_s, 0.05, .unit = "s", .meaning = "time before the motor starts",
                 .range = rig::from_zero(60), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, coast_s, 0.01, .unit = "s", .meaning = "time between motor off and brake on",
                 .range = rig::from_zero(60), .safety = rig::no_effect_on_safety);
  /// 0 lets the rig run out.
  ABS_HIL_OPTION(double, hold_torque_Nm, 2.0, .unit = "N m",
                 .meaning = "brake torque from the end of slip control to standstill", .range = rig::from_zero(100),
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, stopped_s, 0.1, .unit = "s", .meaning = "time recorded after standstill",
                 .range = rig::from_zero(60), .safety = rig::no_effect_on_safety);
  /// A phase that lasts longer than its limit is a fault.
  ABS_HIL_OPTION(double, accelerate_limit_s, 20.0, .unit = "s", .meaning = "time limit of acceleration",
                 .range = rig::positive(600), .safety = rig::weaker_above(20));
  ABS_HIL_OPTION(double, brake_limit_s, 30.0, .unit = "s", .meaning = "time limit of braking",
                 .range = rig::positive(600), .safety = rig::weaker_above(30));
  ABS_HIL_OPTION(double, hold_limit_s, 30.0, .unit = "s", .meaning = "time limit of holding",
                 .range = rig::positive(600), .safety = rig::weaker_above(30));
  ABS_HIL_OPTION(double, stop_brake_duty, 0.0,
                 .meaning = "brake PWM from a stop request to standstill; 0: released at once",
                 .range = rig::from_zero(1), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, stop_brake_limit_s, 5.0, .unit = "s", .meaning = "... but no longer than this",
                 .range = rig::positive(60), .safety = rig::weaker_above(5));
  /// A run writes here what auto came to, so that a replay does the same.
  ABS_HIL_OPTION(std::string, answers, "auto",
                 .meaning =
                     "who answers questions of phases; auto: a person on a rig or at a terminal, else the "
                     "simulation itself, at once",
                 .allowed = {"auto", answers_person, answers_itself}, .safety = rig::weaker_if(answers_itself));
  ABS_HIL_OPTION(bool, wait_for_start, false, .meaning = "stay idle until a command gives the start",
                 .safety = rig::no_effect_on_safety);
};

/// Everything below `rig.` in the configuration: what the rig behind a board is, whatever a controller believes. The
/// limits of gate, checks and observers come from it, and the commissioning record holds it. In simulation the plant is
/// the identity.
struct RigIdentity {
  ABS_HIL_OPTIONS(RigIdentity);
  ABS_HIL_OPTION(std::string, source, "paper-table1", .key = "identity",
                 .meaning = "plant by name or file that describes the rig behind a board: the limits come from it",
                 .safety = rig::commissioned);
  ABS_HIL_GROUP(rig::RigParameters, parameters, "", {});
};

}  // namespace abs_hil::experiment
