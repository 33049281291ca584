// The simulated rig of a run in lanes, and what its controller sees of it. The same equations as plant_sim::Plant,
// plant_sim::Encoder and SimDriver, over a scalar S: a `double`, or a pack in which every lane is a run.
//
//   wheels    J1 omega1' = r1 F - d1 omega1 - M10 - Tb,  J2 omega2' = -r2 F - d2 omega2 - M20        (1), (2)
//   brake     Tb' = c31 (b(u) - Tb),  b of (7); ideal: Tb = the torque that is sent                  (6)
//   standing  omega1' = 0 while |r1 F| <= M10 + Tb
//   counts    floor((angle + offset) / (2 pi / counts per revolution))
//   board     duty that is sent = floor(duty * steps + 1/2) / steps
//
// Speeds in rad/s, angles in rad, torques in N m, F in N by the tyre and load models. plant_sim/runge_kutta.hpp solves
// them over a cycle. Where a wheel stops or starts, or the road or a drift changes, the scalar plant computes the cycle
// ("assist").
#pragma once

#include <limits>

#include "abs_hil/rig/brake_map.hpp"
#include "control/speed_tracker.hpp"
#include "plant_sim/runge_kutta.hpp"

namespace abs_hil::study::lanes {

/// The values of road and drift, and until when they hold: plant_sim::PlantConditions.
template <class S>
struct LaneConditions {
  plant_sim::BasicWheels<S> wheels{};
  S friction{1.0};
  S brake_torque{1.0};
  S steady_to_ns{std::numeric_limits<double>::infinity()};
  S steady_to_angle2_rad{std::numeric_limits<double>::infinity()};
};

/// The rig: plant, encoders, and what the board makes of a duty.
template <class S, class Tyre, class Load>
struct LaneRig {
  Tyre tyre{};
  Load load{};
  LaneConditions<S> now{};
  S max_step_s{0.0};
  rig::BasicBrake<S> brake{};
  S ideal_brake{0.0};  ///< 1: the brake gives the torque that is sent at once
  plant_sim::BasicState<S> x{};
  S steps{0.0};  ///< of the latest cycle
  S rad_per_count{0.0};
  S upper_offset_rad{0.0};
  S lower_offset_rad{0.0};
  S duty_steps{0.0};

  /// Advances by `duration_s`, to `time_ns`, under a duty of the brake, or an ideal brake's torque. True where a wheel
  /// stops or starts, or road or drift change: the state is wrong there.
  [[gnu::noinline, gnu::flatten]] auto advance(const S& duration_s, const S& time_ns, const S& duty,
                                               const S& torque_Nm) noexcept {
    using namespace plant_sim;
    const auto ideal = ideal_brake > 0.0;
    const S static_Nm = rig::select(ideal, torque_Nm, rig::brake_torque_at(brake, duty));
    const BrakeAlone<S> held{static_Nm * now.brake_torque, rig::select(ideal, S(0.0), brake.c31_per_s)};
    x[brake_torque] = rig::select(ideal, held.brake_target_Nm, x[brake_torque]);
    const auto rolls = x[omega1] > 0.0 && x[omega2] > 0.0;
    const auto stands = x[omega1] == 0.0 && x[omega2] > 0.0;
    auto well = rolls;
    if (rig::any(rolls)) {
      const RollingBalance<S, Tyre, Load, BrakeAlone<S>> balance{tyre, load, now.wheels, held, now.friction};
      well = go_on(balance, duration_s, rolls,
                   [](const BasicState<S>& end) { return end[omega1] > 0.0 && end[omega2] > 0.0; });
    }
    if (rig::any(stands)) well = well || stand(held, duration_s, stands);
    return !well || time_ns > now.steady_to_ns || x[angle2] > now.steady_to_angle2_rad;
  }
  [[nodiscard]] S counts(const S& angle_rad) const noexcept { return rig::round_down(S(angle_rad / rad_per_count)); }
  [[nodiscard]] S upper_counts() const noexcept { return counts(x[plant_sim::angle1] + upper_offset_rad); }
  [[nodiscard]] S lower_counts() const noexcept { return counts(x[plant_sim::angle2] + lower_offset_rad); }
  [[nodiscard]] S sent_duty(const S& duty) const noexcept {
    return rig::whole_part(S(duty * duty_steps + 0.5)) / duty_steps;
  }
  [[nodiscard]] S v_x_m_s() const noexcept { return now.wheels.r2_m * x[plant_sim::omega2]; }
  [[nodiscard]] S slip() const noexcept { return tyre.slip(S(now.wheels.r1_m * x[plant_sim::omega1]), v_x_m_s()); }
  [[nodiscard]] S peak_force_N() const noexcept {
    using namespace plant_sim;
    const BrakeAlone<S> any{};
    const RollingBalance<S, Tyre, Load, BrakeAlone<S>> turning{tyre, load, now.wheels, any, now.friction};
    const S turning_N = load.force_N(now.friction, S(1.0), turning.upper_torques(x));
    if constexpr (Load::knows_sliding) {
      const auto stands = x[omega1] == 0.0;
      if (!rig::any(stands)) return turning_N;
      const HeldBalance held{tyre, load, now.wheels, any, now.friction};
      const S held_N = load.force_N(now.friction, S(1.0), held.upper_torques(x));
      return rig::select(stands && held.holds_upper(x), held_N, turning_N);
    } else {
      return turning_N;
    }
  }

 private:
  using HeldBalance = plant_sim::RollingBalance<S, Tyre, Load, plant_sim::BrakeAlone<S>, plant_sim::Held>;

  /// Makes all steps of a cycle in these lanes. True where `well(end)` at the end of each.
  template <class Balance, class Condition, class Well>
  [[gnu::always_inline]] Condition go_on(const Balance& balance, const S& duration_s, const Condition& where,
                                         const Well& well) noexcept {
    using namespace plant_sim;
    const S needed = steps_for(duration_s, max_step_s, balance.fastest_rate_per_s(x));
    steps = rig::select(where, needed, steps);
    return where && steps_made(balance, needed, S(duration_s / needed), where, x, well) == needed;
  }
  /// A cycle in which the brake holds the upper wheel. True where it does so throughout.
  template <class Condition>
  [[gnu::noinline, gnu::flatten]] Condition stand(const plant_sim::BrakeAlone<S>& held, const S& duration_s,
                                                  const Condition& stands) noexcept {
    const HeldBalance balance{tyre, load, now.wheels, held, now.friction};
    return go_on(balance, duration_s, stands && balance.holds_upper(x), [&](const plant_sim::BasicState<S>& end) {
      return balance.holds_upper(end) && end[plant_sim::omega2] > 0.0;
    });
  }
};

/// A wheel as the controller sees it: its counter, and the speed and acceleration that the tracker makes of it.
template <class S>
struct LaneWheel {
  control::SpeedTracker<S> tracker{};
  S counts{0.0};
  S travel{0.0};  ///< counts over the past cycle
  S omega_rad_s{0.0};
  S alpha_rad_s2{0.0};
  S travel_rad{0.0};

  void begin(const S& counts_now, const S& start_speed_rad_s) noexcept {
    counts = counts_now;
    tracker.reset(start_speed_rad_s);
    omega_rad_s = start_speed_rad_s;
  }
  /// Takes a reading, and the true speed where sensors are ideal.
  template <class Condition>
  void take(const S& counts_now, const Condition& ideal, const S& true_rad_s, const S& dt_s) noexcept {
    travel = counts_now - counts;
    counts = counts_now;
    tracker.take(travel);
    const S before_rad_s = omega_rad_s;
    omega_rad_s = rig::select(ideal, true_rad_s, tracker.omega_rad_s());
    alpha_rad_s2 = rig::select(ideal, S((true_rad_s - before_rad_s) / dt_s), tracker.alpha_rad_s2());
    travel_rad = rig::select(ideal, S(0.5 * (before_rad_s + true_rad_s) * dt_s), S(travel * tracker.rad_per_count()));
  }
  template <class Condition>
  [[nodiscard]] Condition stands_still(const Condition& ideal) const noexcept {
    return (ideal && omega_rad_s == 0.0) || (!ideal && tracker.stands_still());
  }
  /// The counter moved further than any wheel can, or nears its end.
  [[nodiscard]] auto leaps(const S& sure_counts) const noexcept {
    constexpr double near_wrap = 2e9;
    return rig::magnitude(travel) > sure_counts || rig::magnitude(counts) > near_wrap;
  }
};

}  // namespace abs_hil::study::lanes
