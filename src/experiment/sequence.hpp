#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/reason.hpp"
#include "experiment/profile.hpp"
#include "runtime/gate_options.hpp"

namespace abs_hil::experiment {

/// What drives the brake during a phase.
enum class BrakeAction : std::uint8_t { released, torque, duty, slip_control };

/// What ends a phase. Speeds are estimates.
enum class EndKind : std::uint8_t {
  duration,           ///< value: s since the phase began
  upper_speed_above,  ///< value: rad/s of the upper wheel
  upper_wheel_peak,   ///< value: s without a new maximum of the upper wheel's speed
  car_speed_below,    ///< value: m/s
  standstill,         ///< both wheels stand; no value
  start_command,      ///< somebody gave the start; no value
  upper_speed_below,  ///< value: rad/s
  lower_speed_above,  ///< value: rad/s of the lower wheel
  lower_speed_below,  ///< value: rad/s
  car_speed_above,    ///< value: m/s
  slip_above,         ///< value: slip
  slip_below,         ///< value: slip
  distance,           ///< value: m that the car has come since the phase began
  all,                ///< all of `parts` hold at the same time; no value
};

struct EndCondition {
  EndKind kind{EndKind::duration};
  double value{0.0};
  rig::Reason reason{rig::Reason::none};  ///< noted when this condition ends the phase
  std::vector<EndCondition> parts{};      ///< for EndKind::all
};

/// One phase: what acts, and what ends it, whichever condition comes first. Outlasting the time limit is a fault.
struct PhasePlan {
  rig::Phase phase{rig::Phase::idle};
  double motor_duty{0.0};
  BrakeAction brake{BrakeAction::released};
  double brake_torque_Nm{0.0};  ///< for BrakeAction::torque
  double brake_duty{0.0};       ///< for BrakeAction::duty
  // Not empty: in place of the constants above, over the time of the phase.
  Profile motor_course{};
  Profile brake_course{};     ///< of the torque or the duty
  Profile slip_ref_course{};  ///< in place of control.slip_ref
  std::vector<EndCondition> ends_on{};
  double time_limit_s{0.0};      ///< in (0, 600]
  bool motor_with_brake{false};  ///< motor and brake may act together in this phase: only where it is asked for

  [[nodiscard]] double motor_duty_at(double time_s) const noexcept {
    return motor_course.empty() ? motor_duty : motor_course.at(time_s);
  }
  [[nodiscard]] double brake_torque_Nm_at(double time_s) const noexcept {
    return brake_course.empty() ? brake_torque_Nm : brake_course.at(time_s);
  }
  [[nodiscard]] double brake_duty_at(double time_s) const noexcept {
    return brake_course.empty() ? brake_duty : brake_course.at(time_s);
  }
};

/// Limits of a whole run; passing one is a fault.
struct SequenceLimits {
  double run_time_s{std::numeric_limits<double>::infinity()};
  double distance_m{std::numeric_limits<double>::infinity()};  ///< that the car comes since the run began
};

/// The brake after a stop request: motor off, this duty until standstill, then released.
struct StopBrake {
  double duty{0.0};     ///< in [0, 1]; 0: the run ends at once
  double limit_s{5.0};  ///< the longest, > 0
};

/// What the sequence looks at in each cycle.
struct SequenceInput {
  double time_s{0.0};  ///< since the start of the run, never decreasing
  rig::WheelSpeeds speeds{};
  double car_speed_m_s{0.0};
  bool stands_still{false};
  bool start_given{false};  ///< by a command
  double slip{0.0};
  double distance_m{0.0};  ///< that the car has come since the run began
};

/// Steps through the phases of an experiment. `update` is real-time safe; the plans are made before the run.
class Sequence {
 public:
  /// Throws std::invalid_argument for an empty list and for an unsafe phase: without an end or a finite time limit,
  /// with a duty or torque outside its range, with motor and brake together that does not say `motor_with_brake`.
  explicit Sequence(std::vector<PhasePlan> plans, const SequenceLimits& limits = {}, const StopBrake& stop_brake = {});

  struct Change {
    bool entered{false};  ///< a phase begins in this cycle
    rig::Reason reason{rig::Reason::none};
    double value{0.0};
  };
  /// Enters the first phase on the first call, afterwards the next one as soon as an end condition holds.
  Change update(const SequenceInput& input) noexcept;
  /// Leaves the plans for the phase `stopped` (stop request) or `fault`, for one last cycle. With a brake for it a stop
  /// request leads through the phase `hold` first. The first reason stays, but for a fault in that phase.
  void end_early(rig::Reason reason, double value) noexcept;

  /// What the plans let act in each phase.
  [[nodiscard]] runtime::PhasePermissions permissions() const noexcept;
  /// The phase that acts in this cycle.
  [[nodiscard]] const PhasePlan& current() const noexcept {
    if (ended_) return last_;
    return stopping_ ? stop_plan_ : plans_[index_];
  }
  /// Its place among the plans, from 0; after a stop request that of the one which it interrupted.
  [[nodiscard]] std::size_t index() const noexcept { return index_; }
  /// How long it has acted, s.
  [[nodiscard]] double phase_time_s() const noexcept { return now_s_ - entered_at_s_; }
  /// True in the run's last cycle: the safe command goes out in it.
  [[nodiscard]] bool finished() const noexcept { return ended_; }

 private:
  [[nodiscard]] const EndCondition* ending(const SequenceInput& input) noexcept;
  [[nodiscard]] bool holds(const EndCondition& condition, const SequenceInput& input) const noexcept;
  [[nodiscard]] bool all_hold(const std::vector<EndCondition>& parts, const SequenceInput& input) const noexcept;
  void enter(std::size_t index, const SequenceInput& input) noexcept;
  Change stop(const SequenceInput& input) noexcept;
  Change end(rig::Phase phase, rig::Reason reason, double value) noexcept;

  std::vector<PhasePlan> plans_;
  SequenceLimits limits_;
  PhasePlan stop_plan_;
  PhasePlan last_{};
  std::size_t index_{0};
  bool started_{false};
  bool stopping_{false};  ///< the brake for a stop acts
  bool ended_{false};
  rig::Reason early_reason_{rig::Reason::none};
  double early_value_{0.0};
  double now_s_{0.0};
  double entered_at_s_{0.0};
  double entered_at_m_{0.0};
  double peak_speed_rad_s_{0.0};
  double peak_at_s_{0.0};
};

}  // namespace abs_hil::experiment
