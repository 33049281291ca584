#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "control/brake_actuator.hpp"
#include "control/encoder_disc.hpp"
#include "control/tracking_observer.hpp"
#include "experiment/options.hpp"
#include "experiment/sequence.hpp"
#include "rig/reason_text.hpp"
#include "rig/run_names.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/spsc_ring.hpp"

namespace abs_hil::experiment {

/// A change to a running run.
struct Adjustment {
  enum class Kind : std::uint8_t { start, slip_ref, controller, answer };
  Kind kind{Kind::start};
  double slip_ref{0.0};
  /// The same control law with other gains, constructed in advance; it takes over the state of the old one.
  std::unique_ptr<control::SlipController> controller{};
};

/// Hands adjustments from one slow thread to the real-time thread, and replaced controllers back. Neither thread waits
/// for the other, and only the slow thread allocates and frees memory.
class AdjustmentMailbox {
 public:
  ~AdjustmentMailbox() {
    Arrived waiting{};
    while (inbox_.pop(waiting)) delete waiting.controller;
    free_retired();
  }

  /// Slow thread. Returns the number of the change, from 1 on; 0 if too many changes wait.
  [[nodiscard]] std::uint32_t put(Adjustment adjustment) {
    free_retired();
    if (!inbox_.push({adjustment.kind, last_number_ + 1, adjustment.slip_ref, adjustment.controller.get()})) return 0;
    static_cast<void>(adjustment.controller.release());
    return ++last_number_;
  }

  /// A change as the real-time thread receives it.
  struct Arrived {
    Adjustment::Kind kind;
    std::uint32_t number;
    double slip_ref;
    control::SlipController* controller;  ///< the taker owns it
  };
  /// Real-time thread. Returns false if nothing waits.
  [[nodiscard]] bool take(Arrived& arrived) noexcept { return inbox_.pop(arrived); }
  /// Real-time thread. Returns a replaced controller to the slow thread.
  void retire(control::SlipController* controller) noexcept { static_cast<void>(retired_.push(controller)); }

 private:
  void free_retired() {
    control::SlipController* controller = nullptr;
    while (retired_.pop(controller)) delete controller;
  }

  static constexpr std::size_t most_waiting = 16;
  runtime::SpscRing<Arrived> inbox_{most_waiting};
  /// Room for all controllers that can be under way, so that none is lost.
  runtime::SpscRing<control::SlipController*> retired_{2 * most_waiting};
  std::uint32_t last_number_{0};
};

/// Below this car speed, encoder noise dominates the estimated slip. Slip control has ended by then.
inline constexpr double slip_floor_m_s = 0.1;

/// The parts of a run's logic.
struct RunLogicParts {
  const control::ControlOptions& control;
  const rig::RigParameters& rig;  ///< the model: the parameters as the controller knows them
  rig::RigParameters identity;    ///< what the limits of gate and observers know of the rig
  std::unique_ptr<control::SlipController> controller;
  rig::RunNames names{};
  Sequence sequence;
  bool ideal_actuator{false};
  double max_brake_duty{1.0};     ///< limit of the command gate
  double start_speed_rad_s{0.0};  ///< both wheels' speed at the first measurement
  bool answers_itself{true};      ///< questions of phases are answered at once, without a person
  std::uint32_t duty_steps{0};    ///< of the driver's PWMs, from duty 0 to duty 1; 0: any duty can be sent
};

/// Makes the parts of a run with the controller named in `control`. Throws std::invalid_argument for unusable options.
/// `control` and `rig` must outlive the construction of the logic.
/// @param rig  the model, as the controller knows the rig
/// @param identity  the rig as it is: of the simulated plant, or of a board's record. The limits come from it
[[nodiscard]] RunLogicParts make_logic_parts(const control::ControlOptions& control, const rig::RigParameters& rig,
                                             const rig::RigParameters& identity, bool ideal_actuator,
                                             const runtime::GateOptions& gate, const ExperimentOptions& experiment,
                                             std::vector<PhasePlan> plans, const SequenceLimits& limits = {});

/// What the eccentricity of the encoders' discs may be as a run begins, rad. Where nothing is learnt, the model's
/// holds.
[[nodiscard]] double unlearnt_disc_rad(const control::ObserverOptions& options,
                                       const rig::RigParameters& model) noexcept;

/// The logic of one run's cycle: estimate, sequence, control; from counts to the wanted command.
class RunLogic final : public runtime::CycleLogic {
 public:
  explicit RunLogic(RunLogicParts parts);

  void wheels_judged(bool sound) noexcept override { wheels_sound_ = sound; }
  [[nodiscard]] rig::Command step(const rig::Measurement& measurement, runtime::RunLatch& latch,
                                  rig::CycleRecord& record) noexcept override;
  void commanded(const rig::Command& sent) noexcept override { commanded(sent, sent); }
  /// The same where the logic's own command did not act: a recorded one did.
  /// @param acted  the command that acted on the rig; the actuator model follows it
  /// @param own  what became of the logic's own command; its integrals follow it
  void commanded(const rig::Command& acted, const rig::Command& own) noexcept;
  [[nodiscard]] bool finished() const noexcept override { return sequence_.finished(); }
  /// The command gate of this run: its options, the permissions of the plans, the limits of the rig's physics. Its caps
  /// are duties that the driver can send, so that no rounding exceeds them.
  /// @param checks_wheels  it judges the motion of the wheels
  [[nodiscard]] runtime::CommandGate make_gate(const runtime::GateOptions& options,
                                               bool checks_wheels = true) const noexcept {
    return runtime::CommandGate(options, sequence_.permissions(),
                                checks_wheels ? runtime::plausibility_limits(identity_, ideal_actuator_, options)
                                              : runtime::PlausibilityLimits{},
                                identity_.brake.u0, sendable(options));
  }
  /// Why the run ended; `none` while it goes on.
  [[nodiscard]] rig::Reason end_reason() const noexcept { return end_.reason; }
  [[nodiscard]] double end_value() const noexcept { return end_.value; }
  [[nodiscard]] control::SlipController& controller() noexcept { return *controller_; }
  [[nodiscard]] const control::SlipController& controller() const noexcept { return *controller_; }
  /// Eccentricity of both encoders' discs as this run has learnt it, 0: sound; NaN where nothing was learnt.
  struct LearntDiscs {
    double upper_rad{rig::unknown};
    double lower_rad{rig::unknown};
  };
  [[nodiscard]] const LearntDiscs& learnt_discs() const noexcept { return learnt_; }
  /// Between cycles, without adjustments on their way. Throws std::invalid_argument for a controller that cannot.
  void exchange_state(rig::StateBytes& state);
  /// Changes put here take effect one per cycle, in cycles in which no phase begins. The cycle's record has an
  /// adjustment as its reason and the change's number as its value. A start command shows in the next cycle's record,
  /// with value 0.
  [[nodiscard]] AdjustmentMailbox& adjustments() noexcept { return adjustments_; }

 private:
  [[nodiscard]] runtime::SendableDuties sendable(const runtime::GateOptions& options) const noexcept;
  void adjust(rig::CycleRecord& record) noexcept;
  [[nodiscard]] double without_bump(double torque_Nm, const control::SlipInput& input) noexcept;
  void estimate(const rig::Measurement& measurement, double dt_s, double stamp_error_s) noexcept;
  void note_travel(const rig::Measurement& measurement, double dt_s) noexcept;
  void learn_eccentricity(const rig::Measurement& measurement, const PhasePlan& plan) noexcept;
  [[nodiscard]] bool refused(const control::SlipOutput& output, bool begins) noexcept;
  [[nodiscard]] bool breaks(std::size_t n, double value, bool begins) noexcept;
  [[nodiscard]] double slip_control(double dt_s, bool begins, rig::ControlState& state) noexcept;
  [[nodiscard]] double wanted_torque_Nm(const PhasePlan& plan, double dt_s, bool begins,
                                        rig::ControlState& state) noexcept;

  const rig::RigParameters identity_;
  const bool ideal_actuator_;
  const std::uint32_t duty_steps_;
  const rig::WheelParameters wheels_;
  double slip_ref_;
  const rig::BrakeParameters brake_;
  const double start_speed_rad_s_;
  std::unique_ptr<control::SlipController> controller_;
  Sequence sequence_;
  control::TrackingObserver upper_;
  control::TrackingObserver lower_;
  const bool learns_eccentricity_;
  control::EccentricityFit upper_fit_;
  control::EccentricityFit lower_fit_;
  LearntDiscs learnt_{};
  double disc_error_rad_;  ///< that a disc may have; 0 once both are known
  control::BrakeActuator actuator_;
  rig::WheelSpeeds speeds_{};
  double upper_travel_rad_{0.0};  ///< over the past interval
  double lower_travel_rad_{0.0};
  double distance_m_{0.0};  ///< distance of the car since the run began
  double slip_{0.0};
  double alpha1_rad_s2_{0.0};
  double alpha2_rad_s2_{0.0};
  AdjustmentMailbox adjustments_;
  /// The old controller if the gains changed in this cycle, until its last torque is known.
  control::SlipController* replaced_{nullptr};
  double asked_Nm_{rig::unknown};  ///< the controller's torque of this cycle; NaN: it was not asked
  double target_Nm_{0.0};          ///< the static torque to send for it
  double sent_Nm_{0.0};            ///< the one that was sent, and what was missing in it
  double unsent_Nm_{0.0};
  bool in_slip_control_{false};  ///< the phase of the latest cycle used the slip controller
  std::size_t own_signal_count_;
  std::array<bool, rig::controller_output_max> not_given_{};  ///< outputs that the controller does not give
  int refused_output_{-1};                                    ///< the first that was not finite; < 0: none
  double bump_Nm_{0.0};                                       ///< remaining offset that keeps the torque continuous
  bool start_given_{false};
  bool answers_itself_;
  bool answered_{false};  ///< the question of the present phase
  Sequence::Change end_{};
  bool stands_still_{false};
  bool wheels_sound_{true};
  bool started_{false};
  std::int64_t start_ns_{0};
  std::int64_t last_ns_{0};
};

}  // namespace abs_hil::experiment
