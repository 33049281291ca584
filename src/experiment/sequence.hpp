#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/reason.hpp"
#include "abs_hil/rig/state_bytes.hpp"
#include "experiment/end_conditions.hpp"
#include "runtime/gate_options.hpp"
#include "runtime/run_latch.hpp"

namespace abs_hil::experiment {

/// How a profile continues between two points.
enum class Between : std::uint8_t { line, hold };

/// A value over the time since its phase began: a constant, or points in order between which it interpolates, constant
/// before the first and after the last. Empty: none is given. `at` is real-time safe; everything else happens before
/// the run.
class Profile {
 public:
  struct Point {
    double time_s{0.0};
    double value{0.0};
  };

  Profile() = default;
  Profile(double constant) : points_{{0.0, constant}} {}  // NOLINT(google-explicit-constructor): a number is one, too
  /// Throws std::invalid_argument for times that are not finite or decrease, and for values that are not finite. Two
  /// points at the same time make a step: the second value holds from then on.
  explicit Profile(std::vector<Point> points, Between between = Between::line)
      : points_(std::move(points)), between_(between) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (!std::isfinite(points_[i].time_s) || !std::isfinite(points_[i].value)) {
        throw std::invalid_argument("each point of a profile needs a finite time and value");
      }
      if (i > 0 && points_[i].time_s < points_[i - 1].time_s) {
        throw std::invalid_argument("the times of a profile must not decrease");
      }
    }
  }

  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  [[nodiscard]] bool constant() const noexcept { return points_.size() <= 1; }
  /// False for a value that may act at some time.
  [[nodiscard]] bool zero() const noexcept { return constant() && at(0.0) == 0.0; }
  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }
  [[nodiscard]] Between between() const noexcept { return between_; }
  /// Value at that time; 0 if there is none.
  [[nodiscard]] double at(double time_s) const noexcept {
    if (points_.empty()) return 0.0;
    const auto after = std::upper_bound(points_.begin(), points_.end(), time_s,
                                        [](double time, const Point& point) { return time < point.time_s; });
    if (after == points_.begin()) return after->value;
    const Point& before = *(after - 1);
    if (after == points_.end() || between_ == Between::hold) return before.value;
    const double part = (time_s - before.time_s) / (after->time_s - before.time_s);
    return before.value + part * (after->value - before.value);
  }

 private:
  std::vector<Point> points_{};
  Between between_{Between::line};
};

/// What sets the brake during a phase.
enum class BrakeAction : std::uint8_t { released, torque, duty, slip_control };

struct EndCondition {
  EndKind kind{EndKind::duration};
  double value{0.0};
  rig::Reason reason{rig::Reason::none};  ///< recorded when this condition ends the phase
  std::vector<EndCondition> parts{};      ///< for EndKind::all
};

/// One phase: its actions, and the conditions of which the first to hold ends it. A condition on speed or slip must
/// hold for two fresh samples in a row, because one sample may be wrong. Exceeding the time limit is a fault.
struct PhasePlan {
  rig::Phase phase{rig::Phase::idle};
  std::string name{};  ///< empty: that of `phase`
  Profile motor_duty{};
  BrakeAction brake{BrakeAction::released};
  Profile brake_torque_Nm{};  ///< for BrakeAction::torque
  Profile brake_duty{};       ///< for BrakeAction::duty
  Profile slip_ref{};         ///< for BrakeAction::slip_control; empty: control.slip_ref
  std::vector<EndCondition> ends_on{};
  double time_limit_s{0.0};      ///< in (0, 600]
  bool motor_with_brake{false};  ///< permits motor and brake together in this phase
  bool restart{false};           ///< the slip controller begins anew, although the phase before used it too
  bool wheels_apart{false};      ///< the upper wheel is lifted off the lower one
  std::string question{};        ///< for a person, who does something before the phase ends; empty: none
};

/// Limits of a whole run; exceeding one is a fault.
struct SequenceLimits {
  double run_time_s{std::numeric_limits<double>::infinity()};
  double distance_m{std::numeric_limits<double>::infinity()};  ///< distance of the car since the run began
};

/// The brake after a stop request, or after a fault that permits it: the motor is off, this duty acts until standstill,
/// then the brake is released.
struct StopBrake {
  double duty{0.0};     ///< in [0, 1]; 0: the run ends at once
  double limit_s{5.0};  ///< time limit, > 0
};

/// The sequence's inputs in each cycle.
struct SequenceInput {
  double time_s{0.0};  ///< since the start of the run, never decreasing
  rig::WheelSpeeds speeds{};
  double car_speed_m_s{0.0};
  bool stands_still{false};
  bool start_given{false};  ///< a start command has arrived
  bool answered{false};     ///< the phase's question is answered
  bool wheels_sound{true};  ///< nothing speaks against the speeds; the last phase ends only then
  double slip{0.0};
  double distance_m{0.0};  ///< distance of the car since the run began
};

/// Steps through the phases of an experiment. `update` is real-time safe. The plans are made before the run.
class Sequence {
 public:
  /// Throws std::invalid_argument for an empty list and for an unsafe phase: one without an end or a finite time limit,
  /// with a duty or torque outside its range, or with motor and brake together but without `motor_with_brake`.
  explicit Sequence(std::vector<PhasePlan> plans, const SequenceLimits& limits = {}, const StopBrake& stop_brake = {},
                    const StopBrake& fault_brake = {});

  struct Change {
    bool entered{false};  ///< a phase begins in this cycle
    rig::Reason reason{rig::Reason::none};
    double value{0.0};
  };
  /// Enters the first phase on the first call, and later the next phase as soon as an end condition holds. Where the
  /// latch has a fault or a stop request, it leaves the plans for one last cycle in phase `fault` or `stopped`. With a
  /// stop brake, a stop request first enters the phase `hold`. With a fault brake, the phase `fault` lasts until
  /// standstill or the brake's limit, unless a fault bars the brake (runtime::brake_may_hold_after). A limit of the
  /// plans that is exceeded is latched.
  Change update(const SequenceInput& input, runtime::RunLatch& latch) noexcept;

  /// Which outputs the plans permit in each phase.
  [[nodiscard]] runtime::PhasePermissions permissions() const noexcept;
  /// The phase that acts in this cycle.
  [[nodiscard]] const PhasePlan& current() const noexcept {
    if (ended_) return last_;
    if (failing_) return fault_plan_;
    return stopping_ ? stop_plan_ : plans_[index_];
  }
  /// Index of the phase among the plans, from 0; after a stop request, of the phase that it interrupted.
  [[nodiscard]] std::size_t index() const noexcept { return index_; }
  /// True if the upper wheel is lifted off the lower one. An early end leaves it where it is.
  [[nodiscard]] bool wheels_apart() const noexcept { return wheels_apart_; }
  /// Time since the phase began, s.
  [[nodiscard]] double phase_time_s() const noexcept { return now_s_ - entered_at_s_; }
  /// True in the run's last cycle, in which the safe command goes out.
  [[nodiscard]] bool finished() const noexcept { return ended_; }

  void exchange_state(rig::StateBytes& state) {
    state(held_, last_.phase, index_, started_, wheels_apart_, stopping_, failing_, ended_, now_s_, entered_at_s_,
          entered_at_m_, peak_speed_rad_s_, peak_at_s_);
  }

 private:
  [[nodiscard]] const EndCondition* ending(const SequenceInput& input) noexcept;
  [[nodiscard]] bool holds(const EndCondition& condition, const SequenceInput& input) const noexcept;
  [[nodiscard]] bool all_hold(const std::vector<EndCondition>& parts, const SequenceInput& input) const noexcept;
  void enter(std::size_t index, const SequenceInput& input) noexcept;
  Change stop(const SequenceInput& input, const runtime::RunLatch& latch) noexcept;
  Change fail(const SequenceInput& input, const runtime::RunLatch& latch) noexcept;
  Change advance(const SequenceInput& input, runtime::RunLatch& latch) noexcept;
  Change end(rig::Phase phase, rig::Reason reason, double value) noexcept;

  std::vector<PhasePlan> plans_;
  SequenceLimits limits_;
  PhasePlan stop_plan_;
  PhasePlan fault_plan_;
  std::vector<std::uint8_t> held_;  ///< for each end condition of the phase: it held for the latest fresh sample
  PhasePlan last_{};
  std::size_t index_{0};
  bool started_{false};
  bool wheels_apart_{false};
  bool stopping_{false};  ///< the stop brake acts
  bool failing_{false};   ///< the fault brake acts
  bool ended_{false};
  double now_s_{-1.0};  ///< time of the latest sample
  double entered_at_s_{0.0};
  double entered_at_m_{0.0};
  double peak_speed_rad_s_{0.0};
  double peak_at_s_{0.0};
};

}  // namespace abs_hil::experiment
