// The table of laws and plants that have lanes, and what the compiled loops over packs take, one for each instruction
// set and kind of run.
#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"
#include "control/adaptive_actuator_controller.hpp"
#include "control/adaptive_controller.hpp"
#include "control/adaptive_optimal_controller.hpp"
#include "control/classic_controllers.hpp"
#include "control/seeking_controllers.hpp"
#include "control/sliding_mode_controllers.hpp"
#include "rig/instruction_sets.hpp"

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
  ABS_HIL_LANE_PLANTS(each, control::AdaptivePredictorLaw)     \
  ABS_HIL_LANE_PLANTS(each, control::AdaptivePeakLaw)          \
  ABS_HIL_LANE_PLANTS(each, control::AdaptiveOptimalLaw)       \
  ABS_HIL_LANE_PLANTS(each, control::MixedSlipDecelerationLaw) \
  ABS_HIL_LANE_PLANTS(each, control::BrakingStiffnessLaw)
#define ABS_HIL_LANE_PLANTS(each, law)                                  \
  each(law, plant_sim::BasicMagicFormula, plant_sim::BasicConstantLoad) \
      each(law, plant_sim::BasicIntecoMu, plant_sim::BasicLeverLoad)

/// The compiled loops over packs: one for each instruction set and each combination of law, tyre and load.
namespace abs_hil::study::lanes {

/// A cycle in which a wheel stops or starts, or road or drift change: what lanes cannot compute.
struct AssistedCycle {
  std::uint32_t run{0};
  double time_ns{0.0};  ///< at its end, since the run began
  double duration_s{0.0};
  double duty{0.0};             ///< of the brake
  double brake_torque_Nm{0.0};  ///< for an ideal brake
};

/// Runs in memory: each has the words of a BrakingRun<double> that has begun.
struct LaneWork {
  double* const* runs{nullptr};
  std::uint32_t* next{nullptr};  ///< room for `count` links
  std::uint32_t count{0};
  std::uint32_t window_cycles{1};  ///< cycles of the gate's speed windows
  /// Integrates the plant of a run over such a cycle.
  /// @param state  of the plant, as plant_sim::StateVector
  /// @param conditions  as LaneConditions<double>
  void (*assist)(void* context, const AssistedCycle& cycle, double* state, double* conditions){nullptr};
  void* context{nullptr};
};

/// Goes on with every run until it is complete or disturbed.
using LaneKernel = void (*)(const LaneWork& work);

/// Combination of law, tyre and load as types.
template <template <class> class Law, template <class> class Tyre, template <class> class Load>
struct LaneKind;

/// Defined in the sources that are compiled for `Isa` alone. Null if this program was not built for it.
template <class Isa, class Kind>
LaneKernel lane_kernel() noexcept;

}  // namespace abs_hil::study::lanes
