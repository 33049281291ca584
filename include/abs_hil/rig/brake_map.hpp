// The brake as plant, model and gate share it: map (7), its inverse, and dead times.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::rig {

/// The brake's map (7) and lag (6) over a scalar (rig/scalar.hpp).
template <class S>
struct BasicBrake {
  S b1_Nm{0.0}, b2_Nm{0.0}, u0{0.0}, c31_per_s{0.0};

  BasicBrake() = default;
  explicit BasicBrake(const BrakeParameters& brake) noexcept
      : b1_Nm(brake.b1_Nm), b2_Nm(brake.b2_Nm), u0(brake.u0), c31_per_s(brake.c31_per_s) {}
};

/// Static brake torque b(u) of (7), N m, for a duty u in [0, 1]; 0 inside the dead zone. Real-time safe.
template <class Brake, class S>
[[nodiscard]] constexpr S brake_torque_at(const Brake& brake, const S& duty) noexcept {
  return select(duty >= brake.u0, larger(S(0.0), S(brake.b1_Nm * duty + brake.b2_Nm)), S(0.0));
}

/// The duties above 0 that a PWM and a cap leave for the brake.
template <class S>
struct BrakeDuties {
  S least{0.0};          ///< the first outside the dead zone
  S most{0.0};           ///< below `least`: the whole range lies inside the dead zone
  S half_least_Nm{0.0};  ///< half of the torque of `least`
  S steps{0.0};          ///< of the PWM, from duty 0 to duty 1; 0: any duty can be given

  BrakeDuties() = default;
  constexpr BrakeDuties(const BrakeParameters& brake, double max_duty, std::uint32_t duty_steps) noexcept
      : least(duty_at_least(brake.u0, duty_steps)),
        most(duty_at_most(max_duty, duty_steps)),
        half_least_Nm(0.5 * brake_torque_at(brake, least)),
        steps(static_cast<double>(duty_steps)) {}
};

/// Inverse of b(u) onto the duties that a PWM of `duty_steps` steps can give (0: any): the duty in [0, max_duty] whose
/// static torque is nearest to `torque_Nm`. It never lies inside the dead zone: torques between 0 and that of the first
/// duty at or above u0 are unreachable, and those nearer to 0 give duty 0. NaN for a torque that is not finite, so that
/// the command gate refuses it. Real-time safe.
template <class Brake, class S>
[[nodiscard]] constexpr S brake_duty_for(const Brake& brake, const S& torque_Nm,
                                         const BrakeDuties<S>& duties) noexcept {
  constexpr double largest = std::numeric_limits<double>::max();
  const auto finite = torque_Nm >= -largest && torque_Nm <= largest;
  const auto none = torque_Nm <= 0.0 || torque_Nm < duties.half_least_Nm || duties.most < duties.least;
  const S duty = select(finite, S((torque_Nm - brake.b2_Nm) / brake.b1_Nm), S(0.0));
  const S within = clamped(duty, duties.least, duties.most);
  // As `nearest_duty`, at once for every number of steps.
  const S nearest = select(duties.steps > 0.0, S(whole_part(S(within * duties.steps + 0.5)) / duties.steps), within);
  const S reachable = select(duty <= duties.least, duties.least, select(duty >= duties.most, duties.most, nearest));
  return select(finite, select(none, S(0.0), reachable), S(std::numeric_limits<double>::quiet_NaN()));
}
[[nodiscard]] constexpr double brake_duty_for(const BrakeParameters& brake, double torque_Nm, double max_duty = 1.0,
                                              std::uint32_t duty_steps = 0) noexcept {
  return brake_duty_for(brake, torque_Nm, BrakeDuties<double>(brake, max_duty, duty_steps));
}

/// The duty that acts of those that were sent: a change acts after the dead time, one to a smaller duty sooner by the
/// lead. A change that acts before an earlier one takes its place. Real-time safe but for the constructors.
class BrakeDelay {
 public:
  BrakeDelay() = default;
  explicit BrakeDelay(const BrakeParameters& brake)
      : rising_s_(brake.brake_dead_time_s),
        falling_s_(std::max(0.0, brake.brake_dead_time_s - brake.brake_release_lead_s)),
        changes_(rising_s_ > 0.0 ? static_cast<std::size_t>(rising_s_ * fastest_cycle_Hz) + 2 : 0) {}

  /// False if every duty acts at once; then the calls below are unnecessary.
  [[nodiscard]] bool any() const noexcept { return !changes_.empty(); }
  /// Returns to a brake that has long been released.
  void start() noexcept {
    first_ = count_ = 0;
    time_s_ = newest_ = duty_ = 0.0;
  }
  /// Takes the duty that is sent from now on.
  void send(double duty) noexcept {
    settle();
    if (duty == newest_) return;
    const double due_s = time_s_ + (duty > newest_ ? rising_s_ : falling_s_);
    newest_ = duty;
    while (count_ > 0 && (at(count_ - 1).due_s >= due_s || count_ == changes_.size())) --count_;
    at(count_++) = {due_s, duty};
    settle();
  }
  /// The duty that acts now.
  [[nodiscard]] double duty() const noexcept { return duty_; }
  /// How long it acts, if no other is sent.
  [[nodiscard]] double steady_s() const noexcept {
    return count_ > 0 ? at(0).due_s - time_s_ : std::numeric_limits<double>::infinity();
  }
  /// Lets a time pass that is no longer than that.
  void pass(double time_s) noexcept {
    time_s_ += time_s;
    settle();
  }
  /// Lets any time pass. Calls `each(duty, part_s)` for its parts, in order, each with the duty that acts in it.
  template <class Each>
  void pass(double time_s, const Each& each) noexcept {
    for (double left_s = time_s; left_s > 0.0;) {
      const double part_s = std::min(left_s, steady_s());
      each(duty_, part_s);
      pass(part_s);
      left_s -= part_s;
    }
  }
  /// Calls `each(duty, part_s)` for the parts of a time from now on, in order, as they are if nothing else is sent.
  template <class Each>
  void foresee(double time_s, const Each& each) const {
    double duty = duty_, passed_s = 0.0;
    for (std::size_t n = 0; n < count_ && at(n).due_s - time_s_ < time_s; ++n) {
      each(duty, at(n).due_s - time_s_ - passed_s);
      passed_s = at(n).due_s - time_s_;
      duty = at(n).duty;
    }
    each(duty, time_s - passed_s);
  }
  void exchange_state(StateBytes& state) { state(changes_, first_, count_, time_s_, newest_, duty_); }

 private:
  /// The duty may change in every cycle. At a higher rate the newest change takes the place of the one before.
  static constexpr double fastest_cycle_Hz = 10e3;
  /// Rounding error of the sum of a run's intervals; a change that is due within it is due.
  static constexpr double due_rounding_s = 1e-11;

  struct Change {
    double due_s;
    double duty;
  };

  [[nodiscard]] Change& at(std::size_t n) noexcept { return changes_[(first_ + n) % changes_.size()]; }
  [[nodiscard]] const Change& at(std::size_t n) const noexcept { return changes_[(first_ + n) % changes_.size()]; }
  void settle() noexcept {
    for (; count_ > 0 && at(0).due_s <= time_s_ + due_rounding_s; --count_) {
      duty_ = at(0).duty;
      first_ = (first_ + 1) % changes_.size();
    }
  }

  double rising_s_{0.0};
  double falling_s_{0.0};
  std::vector<Change> changes_{};  ///< a ring of those on their way; empty: without dead time
  std::size_t first_{0};
  std::size_t count_{0};
  double time_s_{0.0};
  double newest_{0.0};  ///< the last that was sent
  double duty_{0.0};
};

}  // namespace abs_hil::rig
