// What adaptive-optimal does in a cycle, over its scalar. adaptive_optimal_controller.hpp includes this file.
#pragma once

#include <utility>

#include "control/adaptive_optimal_controller.hpp"

namespace abs_hil::control {

namespace adaptive_optimal {

// Torques of the paper's rig; others have them times their RigScale.
inline constexpr double least_hold_Nm = 0.05;  ///< the limits below need a torque that can still fall
inline constexpr double least_room_Nm = 0.2;   ///< the same for a torque near the brake's largest
inline constexpr double usual_hold_Nm = 1.0;   ///< before a force is seen
// The force at the peak is taken as known up to the first relative spread, as unknown from the second on.
inline constexpr double known_spread = 0.15;
inline constexpr double unknown_spread = 0.4;
/// Besides a dead time, until the force shows what a torque does.
inline constexpr double seen_after_s = 0.01;
/// Part of a swing once a turn that the observer's force shows.
inline constexpr double quick_passes = 0.5;
// The early search begins when the first force has come through the filters, and fades.
inline constexpr double early_from_s = 0.06;
inline constexpr double early_lasts_s = 0.08;

}  // namespace adaptive_optimal

template <class S>
S AdaptiveOptimalLaw<S>::slip_of(const Speeds& speeds) const noexcept {
  return rig::wheel_slip(S(laws_.r1 * speeds.omega1_rad_s), S(laws_.r2 * speeds.omega2_rad_s), v_min_m_s_);
}

/// An angle that swings by e once a turn looks like an acceleration that swings by e omega^2. The lags of the force
/// pass less of it.
template <class S>
auto AdaptiveOptimalLaw<S>::swing(const S& disc_error_rad, const S& omega_rad_s) const noexcept ->
    typename Bank::Swing {
  if (!rig::any(disc_error_rad > 0.0)) return {};
  const S force_N = laws_.J2 * disc_error_rad * omega_rad_s * omega_rad_s / laws_.r2;
  const S ratio = omega_rad_s / options_.bank.force_bandwidth_rad_s;
  const S one_lag = 1.0 / rig::square_root(S(1.0 + ratio * ratio));
  return {.force_N = force_N * one_lag * one_lag * one_lag,
          .quick_force_N = adaptive_optimal::quick_passes * force_N,
          .speed_m_s = laws_.r2 * disc_error_rad * omega_rad_s};
}

template <class S>
void AdaptiveOptimalLaw<S>::learn(const BasicSlipInput<S>& input, const S& slip) noexcept {
  if (!rig::any(input.dt_s > 0.0)) return;
  const auto travel_rad = [&](const S& known_rad, const S& last_rad_s, const S& rad_s) {
    return rig::select(rig::is_nan(known_rad), S(0.5 * (last_rad_s + rad_s) * input.dt_s), known_rad);
  };
  const Speeds last = std::exchange(last_speeds_, input.speeds);
  unlearnt_.upper_rad += travel_rad(input.upper_travel_rad, last.omega1_rad_s, input.speeds.omega1_rad_s);
  unlearnt_.lower_rad += travel_rad(input.lower_travel_rad, last.omega2_rad_s, input.speeds.omega2_rad_s);
  unlearnt_.time_s += input.dt_s;
  unlearnt_.cycles += S(1.0);
  if (!rig::any(unlearnt_.cycles >= learns_every_)) return;
  const Unlearnt step = std::exchange(unlearnt_, {});
  const S omega2_est = observer_.speeds().omega2_rad_s;
  const S v_x = rig::larger(S(laws_.r2 * omega2_est), v_min_m_s_);
  force_.update(step.time_s, step.lower_rad, omega2_est);
  speeds_.update(force_.covered(), step.time_s, step.upper_rad, step.lower_rad);
  bank_.learn({.dt_s = step.time_s,
               .slip = slip,
               .late_slip = slip_of(speeds_.speeds()),
               .car_speed_m_s = laws_.r2 * omega2_est,
               .force_N = force_.force_N(),
               .covered = force_.covered(),
               .quick_force_N = observer_.force_N(),
               .swing = swing(input.disc_error_rad, omega2_est),
               .runaway_per_N = laws_.r1 / (loop_.mass_kg_m * v_x * brake_.c31_per_s)});
  // The balance of both wheels, against that of the curve at the same slip.
  const paper::Reading<S> same{.omega1 = S(0.0), .omega2 = S(0.0), .lambda_ref = S(0.0), .phi = S(1.0)};
  const S missing_Nm =
      laws_.T_b(laws_.k(same) * (observer_.force_N() - bank_.late_force_N())) - observer_.brake_error_Nm();
  if (rig::any(step.time_s != step_s_)) {
    step_s_ = step.time_s;
    error_covered_ = -rig::exponential_less_one(S(-options_.model_error_per_s * step_s_));
  }
  model_error_Nm_ += error_covered_ * (missing_Nm - model_error_Nm_);
}

/// If the slip runs away within the time that the brake takes to act, the reference must not be past the peak, whatever
/// is expected of it. Behind a dead time the loop does not swing past the peak by itself, and a flat curve shows its
/// peak only farther out: there the reference goes on, as long as the slip would not run away within dead time and lag.
template <class S>
S AdaptiveOptimalLaw<S>::peak_factor() const noexcept {
  constexpr double least = 0.75, flat_runaway = 0.12, flat_part = 0.5;
  const S factor =
      rig::larger(S(least), 1.0 + (options_.peak_factor - 1.0) * (1.0 - bank_.runaway() / options_.runaway));
  if (!rig::any(dead_time_s_ > 0.0)) return factor;
  const S runaway = bank_.runaway() * (1.0 + brake_.c31_per_s * dead_time_s_);
  const S farther = flat_part * rig::larger(S(0.0), S(1.0 - runaway / flat_runaway));
  return factor + rig::select(dead_time_s_ > 0.0, farther, S(0.0));
}

/// Where the slip runs away behind the peak, a search passes the peak and costs more than it finds. But the first noise
/// of coarse counts may show a peak at far too small a slip, and a slip that rests there never shows another one.
template <class S>
S AdaptiveOptimalLaw<S>::search_part() const noexcept {
  using namespace adaptive_optimal;
  const S part = options_.search_part * rig::larger(S(0.0), S(1.0 - bank_.runaway()));
  if (!rig::any(early_part_ > 0.0)) return part;
  return part + rig::select(braked_s_ > early_from_s, S(early_part_ * rig::exponential(S(-braked_s_ / early_lasts_s))),
                            S(0.0));
}

template <class S>
S AdaptiveOptimalLaw<S>::next_reference(const S& dt_s) noexcept {
  const S target = rig::clamped(S(peak_factor() * bank_.peak_slip()), options_.slip_min, options_.slip_max);
  if (rig::any(dt_s != cycle_s_)) {
    cycle_s_ = dt_s;
    largest_rise_ = rig::exponential(S(options_.slip_rate_per_s * dt_s));
  }
  // A peak that turns out to be near must not be passed: only a rise takes time.
  reference_ = rig::smaller(target, reference_ * largest_rise_);
  search_rad_ = within_half_turn_rad(S(search_rad_ + options_.search_rad_s * dt_s));
  braked_s_ += dt_s;
  return reference_ * (1.0 + search_part() * rig::sine(search_rad_)) - bank_.slip_zero();
}

template <class S>
S AdaptiveOptimalLaw<S>::holding_torque_Nm(const Speeds& speeds, const S& slip, const S& force_N) const noexcept {
  const paper::Reading<S> reading{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = slip, .phi = S(1.0)};
  return rig::larger(S(adaptive_optimal::least_hold_Nm * torque_scale_),
                     laws_.T_b(laws_.xi_1(reading, S(0.0), force_N)) + model_error_Nm_);
}

/// Before the peak is known: dare an excess that costs no more than `bold_slip` if the peak is here, and dare at least
/// that if nothing is known.
template <class S>
S AdaptiveOptimalLaw<S>::dared_torque_Nm(const typename Bank::Force& wanted, const S& wanted_Nm,
                                         const Situation& here) const noexcept {
  using namespace adaptive_optimal;
  const Speeds& speeds = here.state.speeds;
  const S here_Nm = holding_torque_Nm(speeds, here.slip, rig::larger(S(0.0), here.force_N));
  const S v_x = rig::larger(S(laws_.r2 * speeds.omega2_rad_s), v_min_m_s_);
  S bold_Nm = rig::square_root(S(2.0 * options_.bold_slip * v_x * loop_.mass_kg_m * loop_.swing_per_s *
                                 rig::larger(here_Nm, S(usual_hold_Nm * torque_scale_))));
  // With a dead time the excess acts that long after its effect on the slip could have shown.
  if (rig::any(dead_time_s_ > 0.0)) {
    const S seen_Nm = options_.bold_slip * v_x * loop_.mass_kg_m / (dead_time_s_ + seen_after_s);
    bold_Nm = rig::select(dead_time_s_ > 0.0, rig::smaller(bold_Nm, seen_Nm), bold_Nm);
  }
  // A spread that moves the torque by less than the play counts as known, however small the force is.
  const S least_N = options_.play_Nm / (known_spread * laws_.r1);
  const S spread = rig::select(wanted.N > 0.0, S(wanted.spread_N / rig::larger(wanted.N, least_N)), S(unknown_spread));
  const S unknown = rig::clamped(S((spread - known_spread) / (unknown_spread - known_spread)), S(0.0), S(1.0));
  return rig::clamped(wanted_Nm, S(here_Nm + unknown * bold_Nm), S(here_Nm + bold_Nm));
}

template <class S>
auto AdaptiveOptimalLaw<S>::holding(const Situation& here, const S& reference, const S& error_m_s) const noexcept
    -> Holding {
  const Speeds& speeds = here.state.speeds;
  const auto wanted = bank_.at(reference);
  const S wanted_Nm = holding_torque_Nm(speeds, reference, wanted.N);
  Holding hold{wanted_Nm, wanted_Nm};
  const auto past = error_m_s > 0.0;
  if (rig::any(past)) {
    // Past the peak the force falls as the slip grows: the torque has to fall below what holds the slip there.
    const auto falls = past && here.force_N < wanted.N;
    if (rig::any(falls))
      hold.here_Nm = rig::select(falls, holding_torque_Nm(speeds, here.slip, here.force_N), wanted_Nm);
  }
  if (rig::any(!past)) {
    const S dared_Nm = dared_torque_Nm(wanted, wanted_Nm, here);
    hold.wanted_Nm = rig::select(past, wanted_Nm, dared_Nm);
    hold.here_Nm = rig::select(past, hold.here_Nm, dared_Nm);
  }
  return hold;
}

/// The brake catches a slip that runs away only if it answers faster, also while the error is small.
template <class S>
S AdaptiveOptimalLaw<S>::near_gain_per_s() const noexcept {
  const S runaway_per_s = bank_.runaway() * brake_.c31_per_s;
  return rig::smaller(rig::larger(options_.slip_gain_per_s, options_.slip_gain_near_per_s),
                      options_.slip_gain_near_per_s + options_.slip_gain_runaway * runaway_per_s);
}

template <class S>
S AdaptiveOptimalLaw<S>::wanted_torque_Nm(const Holding& hold, const S& error_m_s, const S& most_Nm) const noexcept {
  const S size = rig::magnitude(error_m_s);
  const auto too_little = error_m_s < 0.0;
  S wanted_Nm(0.0);
  if (rig::any(too_little)) wanted_Nm = hold.wanted_Nm + loop_.excess_Nm(size, hold.wanted_Nm, options_.authority);
  if (!rig::any(!too_little)) return wanted_Nm;
  const auto below = [&](const S& torque_Nm, const S& authority) -> S {
    const S room_Nm = rig::larger(S(adaptive_optimal::least_room_Nm * torque_scale_), most_Nm - torque_Nm);
    return torque_Nm - loop_.excess_Nm(size, room_Nm, authority);
  };
  return rig::select(
      too_little, wanted_Nm,
      rig::smaller(below(hold.wanted_Nm, options_.authority), below(hold.here_Nm, options_.authority_past_peak)));
}

template <class S>
S AdaptiveOptimalLaw<S>::through_lag_Nm(const S& torque_Nm, const S& wanted_Nm) const noexcept {
  const S error_Nm = wanted_Nm - torque_Nm;
  const S size = rig::magnitude(error_Nm);
  const S near = options_.torque_gain_near_per_s;
  const S gain = near + (options_.torque_gain_per_s - near) * size / (size + options_.torque_near_Nm);
  return lag_.command_Nm(torque_Nm, S(-rig::exponential_less_one(S(-gain * period_s_)) * error_Nm));
}

template <class S>
S AdaptiveOptimalLaw<S>::with_play_Nm(const S& torque_Nm, const S& most_Nm) noexcept {
  const auto at_an_end = torque_Nm <= 0.0 || torque_Nm >= most_Nm;
  const S rests_Nm = rig::clamped(sent_Nm_, rig::larger(S(0.0), torque_Nm - options_.play_Nm),
                                  rig::smaller(most_Nm, torque_Nm + options_.play_Nm));
  return sent_Nm_ = rig::select(at_an_end, rig::clamped(torque_Nm, S(0.0), most_Nm), rests_Nm);
}

template <class S>
auto AdaptiveOptimalLaw<S>::ahead(const BasicSlipInput<S>& input, const S& slip) const noexcept -> Situation {
  Situation here{{observer_.speeds(), input.brake_torque_Nm}, slip, bank_.force_N()};
  if (input.ahead.torques_Nm.empty()) return here;
  // What is missing in the holding torque is missing in the brake's.
  here.state = predictor_(input.ahead, here.state, S(-model_error_Nm_), [&](const S& at) { return bank_.point(at); });
  here.slip = slip_of(here.state.speeds);
  here.force_N = bank_.point(here.slip).N;
  return here;
}

template <class S>
BasicSlipOutput<S> AdaptiveOptimalLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  observer_.update(input);
  const S slip = slip_of(observer_.speeds());
  learn(input, slip);
  const Situation here = ahead(input, slip);
  loop_.near_per_s = near_gain_per_s();
  const S reference = next_reference(input.dt_s);
  const S error_m_s = slip_velocity_error_m_s(laws_, here.state.speeds, reference);
  const S most_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
  const S wanted_Nm = wanted_torque_Nm(holding(here, reference, error_m_s), error_m_s, most_Nm);
  const auto lags = rig::is_finite(input.max_brake_torque_Nm);
  const S command_Nm =
      rig::any(lags) ? rig::select(lags, through_lag_Nm(here.state.brake_torque_Nm, wanted_Nm), wanted_Nm) : wanted_Nm;
  return {.brake_torque_Nm = with_play_Nm(command_Nm, most_Nm),
          .slip_velocity_error_m_s = error_m_s,
          .theta_est_N = bank_.peak_force_N(),
          .slip_ref = reference};
}

}  // namespace abs_hil::control
