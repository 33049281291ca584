#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "control/brake_actuator.hpp"
#include "control/tracking_observer.hpp"
#include "experiment/adjustment.hpp"
#include "experiment/options.hpp"
#include "experiment/sequence.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cycle_logic.hpp"

namespace abs_hil::experiment {

/// What a run's logic is made of.
struct RunLogicParts {
  const control::ControlOptions& control;
  const rig::RigParameters& rig;  ///< nominal parameters, as the controller knows them
  std::unique_ptr<control::SlipController> controller;
  Sequence sequence;
  bool ideal_actuator{false};
  double max_brake_duty{1.0};     ///< as the gate limits it
  double start_speed_rad_s{0.0};  ///< both wheels' speed at the first measurement
};

/// The parts of a run with the controller that `control` names. Throws std::invalid_argument for options that are not
/// usable. `control` and `rig` must outlive the construction of the logic.
[[nodiscard]] RunLogicParts make_logic_parts(const control::ControlOptions& control, const rig::RigParameters& rig,
                                             bool ideal_actuator, const runtime::GateOptions& gate,
                                             const ExperimentOptions& experiment, std::vector<PhasePlan> plans,
                                             const SequenceLimits& limits = {});

/// estimate -> sequence -> control of one run: from counts to the command wanted.
class RunLogic final : public runtime::CycleLogic {
 public:
  explicit RunLogic(RunLogicParts parts);

  [[nodiscard]] rig::Command step(const rig::Measurement& measurement, rig::CycleRecord& record) noexcept override;
  void commanded(const rig::Command& command) noexcept override;
  void end_early(rig::Reason reason, double value) noexcept override { sequence_.end_early(reason, value); }
  [[nodiscard]] bool finished() const noexcept override { return sequence_.finished(); }
  /// The gate of this run: its options, what the plans permit, what the rig's physics allows.
  [[nodiscard]] runtime::CommandGate make_gate(const runtime::GateOptions& options) const noexcept {
    return runtime::CommandGate(options, sequence_.permissions(),
                                runtime::plausibility_limits(rig_, ideal_actuator_, options));
  }
  /// What each phase's plan lets act.
  [[nodiscard]] runtime::PhasePermissions permissions() const noexcept { return sequence_.permissions(); }
  /// Why the run ended; `none` while it has not.
  [[nodiscard]] rig::Reason end_reason() const noexcept { return end_.reason; }
  [[nodiscard]] double end_value() const noexcept { return end_.value; }
  /// Changes put here take effect one a cycle, in cycles in which no phase begins. The record of the cycle says so: its
  /// reason is an adjustment's and its value the change's number (for the start, in the cycle after: 0).
  [[nodiscard]] AdjustmentMailbox& adjustments() noexcept { return adjustments_; }

 private:
  void adjust(rig::CycleRecord& record) noexcept;
  [[nodiscard]] double without_bump(double torque_Nm, const control::SlipInput& input) noexcept;
  void estimate(const rig::Measurement& measurement, double dt_s) noexcept;
  void note_travel(const rig::Measurement& measurement, double dt_s) noexcept;
  [[nodiscard]] double slip_control(double dt_s, bool entered, rig::ControlState& state) noexcept;
  [[nodiscard]] double wanted_torque_Nm(const PhasePlan& plan, double dt_s, bool entered,
                                        rig::ControlState& state) noexcept;

  const rig::RigParameters rig_;
  const bool ideal_actuator_;
  const rig::WheelParameters wheels_;
  const double rad_per_count_;
  double slip_ref_;
  const rig::BrakeParameters brake_;
  const double start_speed_rad_s_;
  std::unique_ptr<control::SlipController> controller_;
  Sequence sequence_;
  control::TrackingObserver upper_;
  control::TrackingObserver lower_;
  control::BrakeActuator actuator_;
  rig::WheelSpeeds speeds_{};
  std::int32_t upper_counts_{0};
  std::int32_t lower_counts_{0};
  double upper_travel_rad_{0.0};  ///< over the past interval
  double lower_travel_rad_{0.0};
  double distance_m_{0.0};  ///< that the car has come since the run began
  double slip_{0.0};
  double alpha1_rad_s2_{0.0};
  double alpha2_rad_s2_{0.0};
  AdjustmentMailbox adjustments_;
  /// The controller whose gains were changed in this cycle, until its last torque is known.
  control::SlipController* replaced_{nullptr};
  double bump_Nm_{0.0};  ///< what the torque still owes to the gains before
  bool start_given_{false};
  Sequence::Change end_{};
  bool stands_still_{false};
  bool started_{false};
  std::int64_t start_ns_{0};
  std::int64_t last_ns_{0};
};

}  // namespace abs_hil::experiment
