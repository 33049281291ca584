// The table of laws and plants that have lanes.
#pragma once

#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"
#include "control/adaptive_actuator_controller.hpp"
#include "control/adaptive_controller.hpp"
#include "control/adaptive_optimal_controller.hpp"
#include "control/adaptive_peak_controller.hpp"
#include "control/braking_stiffness_controller.hpp"
#include "control/classic_controllers.hpp"
#include "control/five_phase_controller.hpp"
#include "control/nominal_controller.hpp"
#include "control/sliding_mode_actuator_controller.hpp"
#include "control/sliding_mode_controllers.hpp"
#include "study/lanes/lane_kernels.hpp"

/// Calls `each(law, tyre, load)` for every combination that has lanes. A run with another one takes the scalar path.
#define ABS_HIL_LANE_KINDS(each)                               \
  ABS_HIL_LANE_PLANTS(each, control::AdaptiveLaw)              \
  ABS_HIL_LANE_PLANTS(each, control::NominalLaw)               \
  ABS_HIL_LANE_PLANTS(each, control::SlidingModeLaw)           \
  ABS_HIL_LANE_PLANTS(each, control::SmoothSlidingModeLaw)     \
  ABS_HIL_LANE_PLANTS(each, control::SuperTwistingLaw)         \
  ABS_HIL_LANE_PLANTS(each, control::PiLaw)                    \
  ABS_HIL_LANE_PLANTS(each, control::RelayLaw)                 \
  ABS_HIL_LANE_PLANTS(each, control::FivePhaseLaw)             \
  ABS_HIL_LANE_PLANTS(each, control::LockedLaw)                \
  ABS_HIL_LANE_PLANTS(each, control::SlidingModeActuatorLaw)   \
  ABS_HIL_LANE_PLANTS(each, control::AdaptiveActuatorLaw)      \
  ABS_HIL_LANE_PLANTS(each, control::AdaptivePeakLaw)          \
  ABS_HIL_LANE_PLANTS(each, control::AdaptiveOptimalLaw)       \
  ABS_HIL_LANE_PLANTS(each, control::MixedSlipDecelerationLaw) \
  ABS_HIL_LANE_PLANTS(each, control::BrakingStiffnessLaw)
#define ABS_HIL_LANE_PLANTS(each, law)                                  \
  each(law, plant_sim::BasicMagicFormula, plant_sim::BasicConstantLoad) \
      each(law, plant_sim::BasicIntecoMu, plant_sim::BasicLeverLoad)
