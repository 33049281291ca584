// The controllers' model of the brake: b(u) of (7) and its inverse, dead times, the lag (6), and the duties that the
// board has.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// The controllers' model of the brake. It computes the duty for a torque by the inverse of (7). It estimates the
/// torque that acts in open loop, by the lag (6), because the rig has no torque sensor. Real-time safe.
template <class S>
class BasicBrakeActuator {
 public:
  BasicBrakeActuator() = default;
  /// @param ideal the reference torque acts at once and without limits (`plant.ideal_actuator`)
  /// @param max_duty largest duty the gate lets pass, in (0, 1]
  /// @param duty_steps steps of the PWM from duty 0 to duty 1; 0: any duty can be sent
  BasicBrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty,
                     std::uint32_t duty_steps = 0) noexcept
      : brake_{brake},
        ideal_{ideal ? 1.0 : 0.0},
        duties_{brake, max_duty, ideal ? 0 : duty_steps},
        max_torque_Nm_{ideal ? std::numeric_limits<double>::infinity()
                             : rig::brake_torque_at(brake, rig::duty_at_most(max_duty, duty_steps))},
        half_step_Nm_{ideal || duty_steps == 0 ? 0.0 : 0.5 * brake.b1_Nm / static_cast<double>(duty_steps)} {
    if (ideal) return;
    least_.duty = rig::duty_at_least(brake.u0, duty_steps);
    least_.torque_Nm = rig::brake_torque_at(brake, least_.duty);
  }

  /// Starts from a brake that has long been released.
  void reset() noexcept {
    target_Nm_ = torque_Nm_ = mean_torque_Nm_ = S(0.0);
    was_in_gap_ = S(0.0);
  }
  /// Advances the model by `dt_s` under the duty of the last `command` (the torque, if ideal): exact solution of (6).
  void advance(const S& dt_s) noexcept;
  /// Prepares `advance` for this time; otherwise `advance` does it when the time changes.
  void prepare(const S& dt_s) noexcept;
  /// Stores the command that was sent now: its duty in [0, 1], or, if ideal, its torque, >= 0.
  void command(const S& duty, const S& torque_Nm) noexcept {
    target_Nm_ = static_torque_Nm(duty, torque_Nm);
    torque_Nm_ = rig::select(ideal_ > 0.0, target_Nm_, torque_Nm_);
  }

  /// The PWM's duty in [0, max_duty] whose torque is nearest to a reference torque. With an ideal actuator it is only
  /// recorded. NaN for a torque that is not finite.
  [[nodiscard]] S duty_for(const S& torque_Nm) const noexcept {
    return rig::brake_duty_for(brake_, torque_Nm, duties_);
  }
  /// Static torque of that duty, or, if ideal, the torque itself, at least 0.
  [[nodiscard]] S limited(const S& torque_Nm) const noexcept { return nearest(torque_Nm).torque_Nm; }
  /// A static torque and the duty that gives it.
  struct Target {
    S torque_Nm{0.0};
    S duty{0.0};
  };
  /// What to send for a reference torque, `dt_s` after the last call: `limited` and `duty_for`, except in the gap
  /// between 0 and the least torque that the dead zone leaves. There it switches between the two ends, so that their
  /// mean is the reference torque: nothing between them can be sent.
  [[nodiscard]] Target next(const S& torque_Nm, const S& dt_s) noexcept;
  /// What is missing of a finite reference torque in a static torque that was sent for it, N m: > 0 if less was sent
  /// (limits, rate limit, refusal), < 0 if more was sent. 0 if only the PWM's steps and the dead zone part the two.
  /// @param target_Nm  the torque of `next` for the reference torque
  [[nodiscard]] S unsent_Nm(const S& reference_Nm, const S& target_Nm, const S& sent_Nm) const noexcept;
  /// Static torque b(u) of a command; its torque, if ideal.
  [[nodiscard]] S static_torque_Nm(const S& duty, const S& torque_Nm) const noexcept {
    return rig::select(ideal_ > 0.0, rig::larger(S(0.0), torque_Nm), rig::brake_torque_at(brake_, duty));
  }
  /// Largest torque that can be sent; infinite if ideal.
  [[nodiscard]] S max_torque_Nm() const noexcept { return max_torque_Nm_; }
  [[nodiscard]] S torque_Nm() const noexcept { return torque_Nm_; }            ///< estimated, now
  [[nodiscard]] S mean_torque_Nm() const noexcept { return mean_torque_Nm_; }  ///< over the last `advance`

 protected:
  S mean_torque_Nm_{0.0};  ///< over the last `advance`

 private:
  [[nodiscard]] Target nearest(const S& torque_Nm) const noexcept {
    const S duty = duty_for(torque_Nm);
    const S torque = rig::select(ideal_ > 0.0, rig::larger(S(0.0), torque_Nm), rig::brake_torque_at(brake_, duty));
    return {rig::select(rig::is_nan(duty), duty, torque), duty};
  }

  rig::BasicBrake<S> brake_{};
  S ideal_{0.0};  ///< 1 if ideal, else 0; so are the other conditions below
  rig::BrakeDuties<S> duties_{};
  S max_torque_Nm_{0.0};
  Target least_{};  ///< the least above 0 that can be sent; 0 if ideal
  S half_step_Nm_{0.0};
  S prepared_s_{0.0};  ///< the time that `advance` is prepared for
  S covered_{0.0};     ///< the share of the distance to b(u) that it covers
  // In the gap: the end that is sent, for how long, and what is owed to the reference torque.
  Target end_{};
  S held_s_{0.0};
  S owed_Nms_{0.0};
  S was_in_gap_{0.0};
  S target_Nm_{0.0};
  S torque_Nm_{0.0};
};

/// The same behind the brake's dead times, for a single run: the estimates are those of the duties that act by now.
class BrakeActuator : public BasicBrakeActuator<double> {
 public:
  BrakeActuator() = default;
  BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty, std::uint32_t duty_steps = 0)
      : BasicBrakeActuator(brake, ideal, max_duty, duty_steps),
        brake_(brake),
        delay_(ideal ? rig::BrakeDelay() : rig::BrakeDelay(brake)),
        parts_(delay_.any() ? parts_of(brake) : 0),
        part_s_(parts_ > 0 ? brake.brake_dead_time_s / static_cast<double>(parts_) : 0.0) {}

  void reset() noexcept {
    BasicBrakeActuator::reset();
    delay_.start();
  }
  void command(double duty, double torque_Nm) noexcept {
    if (delay_.any()) [[unlikely]]
      delay_.send(duty);
    else
      BasicBrakeActuator::command(duty, torque_Nm);
  }
  void advance(double dt_s) noexcept {
    if (!delay_.any()) [[likely]]
      return BasicBrakeActuator::advance(dt_s);
    double impulse_Nms = 0.0;
    delay_.pass(dt_s, [&](double duty, double part_s) {
      BasicBrakeActuator::command(duty, 0.0);
      BasicBrakeActuator::advance(part_s);
      impulse_Nms += part_s * mean_torque_Nm_;
    });
    if (dt_s > 0.0) mean_torque_Nm_ = impulse_Nms / dt_s;
  }
  /// The static torques that act until one that is sent now acts, for SlipInput.
  [[nodiscard]] BasicBrakeAhead<double> ahead() noexcept {
    if (parts_ == 0) [[likely]]
      return {};
    ahead_Nm_.fill(0.0);
    double passed_s = 0.0;
    delay_.foresee(part_s_ * static_cast<double>(parts_), [&](double duty, double time_s) {
      const double torque_Nm = rig::brake_torque_at(brake_, duty);
      for (const double until_s = passed_s + time_s; passed_s < until_s;) {
        const auto part = std::min(parts_ - 1, static_cast<std::size_t>(passed_s / part_s_ + rounding));
        const double end_s = part + 1 < parts_ ? std::min(until_s, static_cast<double>(part + 1) * part_s_) : until_s;
        ahead_Nm_[part] += torque_Nm * (end_s - passed_s) / part_s_;
        passed_s = end_s;
      }
    });
    return {{ahead_Nm_.data(), parts_}, part_s_};
  }
  void exchange_state(rig::StateBytes& state) {
    state(static_cast<BasicBrakeActuator<double>&>(*this));
    delay_.exchange_state(state);
  }

 private:
  // Within a part the slip's motion is nearly linear. Half as long, it costs twice the instructions.
  static constexpr double usual_part_s = 6e-3;
  static constexpr std::size_t most_parts = 16;
  static constexpr double rounding = 1e-9;

  [[nodiscard]] static std::size_t parts_of(const rig::BrakeParameters& brake) noexcept {
    const double parts = std::ceil(brake.brake_dead_time_s / usual_part_s - rounding);
    return static_cast<std::size_t>(std::clamp(parts, 1.0, static_cast<double>(most_parts)));
  }

  rig::BasicBrake<double> brake_{};
  rig::BrakeDelay delay_{};
  std::size_t parts_{0};
  double part_s_{0.0};
  std::array<double, most_parts> ahead_Nm_{};
};

template <class S>
void BasicBrakeActuator<S>::prepare(const S& dt_s) noexcept {
  prepared_s_ = dt_s;
  // (6) at a constant duty: the distance to b(u) shrinks by exp(-c31 dt).
  covered_ = -rig::exponential_less_one(S(-brake_.c31_per_s * dt_s));
}

template <class S>
void BasicBrakeActuator<S>::advance(const S& dt_s) noexcept {
  if constexpr (std::is_same_v<S, double>) {
    if (!(dt_s > 0.0)) return;
    if (dt_s != prepared_s_) prepare(dt_s);
  }
  const S change_Nm = (target_Nm_ - torque_Nm_) * covered_;
  // The integral of the distance is its loss / c31.
  const S mean_Nm = target_Nm_ - change_Nm / (brake_.c31_per_s * dt_s);
  const auto moves = covered_ > 0.0;  // not by a lag so long that the share vanishes
  mean_torque_Nm_ = rig::select(ideal_ > 0.0, target_Nm_, rig::select(moves, mean_Nm, torque_Nm_));
  torque_Nm_ = rig::select(ideal_ > 0.0, torque_Nm_, S(torque_Nm_ + change_Nm));
}

template <class S>
auto BasicBrakeActuator<S>::next(const S& torque_Nm, const S& dt_s) noexcept -> Target {
  // Time between two decisions in the gap: a period of the boards' PWMs at their default of 160 Hz, and far below the
  // time constant of the brake.
  constexpr double gap_hold_s = 1.0 / 160.0;
  constexpr double rounding_s = 1e-9;
  const auto in_gap = torque_Nm > 0.0 && torque_Nm < least_.torque_Nm && least_.torque_Nm <= max_torque_Nm_;
  Target target = nearest(torque_Nm);
  if (rig::any(in_gap)) {
    const auto stays = in_gap && was_in_gap_ > 0.0;
    const S most_Nms = least_.torque_Nm * gap_hold_s;
    const S owed_Nms = rig::clamped(S(owed_Nms_ + (torque_Nm - end_.torque_Nm) * dt_s), S(-most_Nms), most_Nms);
    owed_Nms_ = rig::select(in_gap, rig::select(stays, owed_Nms, S(0.0)), owed_Nms_);
    held_s_ = rig::select(in_gap, S(held_s_ + dt_s), held_s_);
    const auto decides = in_gap && (!stays || held_s_ + rounding_s >= gap_hold_s);
    const auto brakes = owed_Nms_ + torque_Nm * gap_hold_s >= 0.5 * most_Nms;
    end_.torque_Nm = rig::select(decides, rig::select(brakes, least_.torque_Nm, S(0.0)), end_.torque_Nm);
    end_.duty = rig::select(decides, rig::select(brakes, least_.duty, S(0.0)), end_.duty);
    held_s_ = rig::select(decides, S(0.0), held_s_);
    target.torque_Nm = rig::select(in_gap, end_.torque_Nm, target.torque_Nm);
    target.duty = rig::select(in_gap, end_.duty, target.duty);
  }
  was_in_gap_ = rig::select(in_gap, S(1.0), S(0.0));
  return target;
}

template <class S>
S BasicBrakeActuator<S>::unsent_Nm(const S& reference_Nm, const S& target_Nm, const S& sent_Nm) const noexcept {
  constexpr double rounding_Nm = 1e-9;
  const auto in_reach = reference_Nm >= 0.0 && reference_Nm <= max_torque_Nm_;
  const auto as_wanted = rig::magnitude(S(target_Nm - sent_Nm)) <= half_step_Nm_ + rounding_Nm;
  return rig::select(in_reach && as_wanted, S(0.0), S(reference_Nm - sent_Nm));
}

}  // namespace abs_hil::control
