// What FrictionBank does in a cycle, over its scalar. friction_bank.hpp has the equations, and includes this file.
#pragma once

#include "control/friction_bank.hpp"

namespace abs_hil::control {

namespace friction_bank {

// Bounds of the unknowns. Forces are those of the paper's rig; others have them times their RigScale.
inline constexpr double theta_min_N = 2.0;
inline constexpr double theta_max_N = 500.0;
inline constexpr double zero_max = 0.025;  ///< as it is read
// It is constant, but for what a curve of another form makes of it. If it wandered farther, the reference could follow
// it down to no slip, and the brake would rest.
inline constexpr double zero_move_max = 0.01;
inline constexpr double theta_variance_min_N2 = 1e-9;
inline constexpr double zero_variance_min = 1e-14;
// The errors of force and slip that are not noise of single cycles last about this long.
inline constexpr double error_lasts_s = 0.005;
// Slower, the slip is made of few counts.
inline constexpr double learning_m_s = 1.0;
inline constexpr double slip_speed_min_m_s = 0.3;
// A slip counts as past a peak by this part of it.
inline constexpr double past_the_peak = 0.1;
// The level is seen in forces above this.
inline constexpr double seen_N = 3.0;
inline constexpr double largest_fall = 0.9;  ///< of the level in a cycle
inline constexpr double largest_rise = 1.15;
// Friction that changes slowly shows in the mean of the unexplained force over about this time.
inline constexpr double unexplained_lasts_s = 0.02;
// exp(-30) is as good as 0, and keeps the weights away from numbers that a double cannot hold.
inline constexpr double log_likelihood_min = -30.0;

/// e^x for x in [-30, 0], within 2 % of it, and within 1e-5 above -5: a likelihood need not be exact.
template <class Row>
[[gnu::always_inline]] inline Row likelihood(const Row& x) noexcept {
  const Row t = x * (1.0 / 64.0);
  Row e = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0))));
  for (int i = 0; i < 6; ++i) e = e * e;
  return e;
}

}  // namespace friction_bank

template <class S>
void BasicFrictionBank<S>::learn(const Data& data) noexcept {
  using namespace friction_bank;
  using friction_curves::square;
  if (!rig::any(data.dt_s > 0.0)) return;
  time_s_ += data.dt_s;
  const S late_reading = late_slip_(data.covered, data.slip);
  // The filter of the slip is as late as three lags, so this is its mean rate of late.
  const S slip_rate_per_s = (data.slip - data.late_slip) * options_.force_bandwidth_rad_s / 3.0;
  watch_for_jumps(data);
  const auto learns = !jumping();
  const S starting = rig::select(time_s_ < options_.start_s, S(1e6), S(1.0));
  const S timing = options_.timing_error_s * slip_rate_per_s;
  const S speed = rig::square_root(S(square(options_.slip_noise_m_s) + square(data.swing.speed_m_s))) /
                  rig::larger(data.car_speed_m_s, S(slip_speed_min_m_s));
  const Look look{
      .slip = data.slip,
      .late_slip = data.late_slip,
      .covered = data.covered,
      .slip_offset = late_reading - data.late_slip,
      .force_N = data.force_N,
      .noise_N2 = starting * rate_Hz_ *
                  (options_.force_noise_N2_s +
                   error_lasts_s * (square(S(options_.force_error * data.force_N)) + 0.5 * square(data.swing.force_N))),
      .slip_error2 = error_lasts_s * rate_Hz_ * (square(timing) + square(speed)),
      .theta_growth = data.dt_s * (options_.level_drift_per_s +
                                   options_.level_drift_unexplained_per_s * square(S(unexplained_N_ / peak_force_N_))),
      .zero_growth = options_.zero_drift_per_s * data.dt_s,
      .back = options_.share_per_s * data.dt_s};
  const auto compares = learns && data.car_speed_m_s > learning_m_s;
  for (std::size_t shape = 0; shape < shapes; ++shape) {
    learn(look, learns, compares, shape, bank_[shape]);
  }
  summarise(data.runaway_per_N);
  if (rig::any(data.dt_s != last_dt_s_)) {
    last_dt_s_ = data.dt_s;
    quick_covered_ = -rig::exponential_less_one(S(-data.dt_s / quick_delay_s_));
  }
  late_force_N_ += quick_covered_ * (force_N_ - late_force_N_);
}

template <class S>
template <class Condition>
void BasicFrictionBank<S>::learn(const Look& look, Condition learns, Condition compares, std::size_t shape,
                                 Members& m) noexcept {
  using namespace friction_bank;
  using friction_curves::square;
  std::array<Row, rows_a_shape> delayed, by_slip;
  for (std::size_t row = 0; row < rows_a_shape; ++row) {
    const Row knee = numbers(friction_curves::derived.knee[shape], row);
    const Row& theta_N = row_of(m.theta_N, row);
    const Row now = friction_curves::value(shape, knee, Row(look.slip + row_of(m.zero, row)));
    by_slip[row] = friction_curves::slope(shape, knee, Row(look.late_slip + row_of(m.zero, row)));
    auto&& late = delay_of(m, row);
    delayed[row] = late(look.covered, now);
    keep(m, row, late);
    Row& theta_variance = row_of(m.theta_variance, row);
    Row& zero_variance = row_of(m.zero_variance, row);
    theta_variance = theta_variance + look.theta_growth * square(theta_N);
    zero_variance = zero_variance + look.zero_growth;
  }
  if (!rig::any(learns)) return;
  for (std::size_t row = 0; row < rows_a_shape; ++row) {
    Row& theta_N = row_of(m.theta_N, row);
    Row& zero = row_of(m.zero, row);
    Row& theta_variance = row_of(m.theta_variance, row);
    Row& covariance = row_of(m.covariance, row);
    Row& zero_variance = row_of(m.zero_variance, row);
    // The gradient of the force that the member expects, by theta and by the zero.
    const Row phi = delayed[row] - by_slip[row] * look.slip_offset;
    const Row by_zero = theta_N * by_slip[row];
    const Row noise = look.noise_N2 + square(by_zero) * look.slip_error2;
    const Row reach_theta = theta_variance * phi + covariance * by_zero;
    const Row reach_zero = covariance * phi + zero_variance * by_zero;
    const Row per = 1.0 / rig::larger(noise, reach_theta * phi + reach_zero * by_zero + noise);
    const Row residual = look.force_N - theta_N * phi;
    const Row gain_theta = reach_theta * per, gain_zero = reach_zero * per;
    if (rig::any(compares)) {
      Row& weight = row_of(m.weight, row);
      const Row log_likelihood = rig::larger(Row(log_likelihood_min), square(residual) * (-0.5 * per));
      const Row seen = (weight + look.back * row_of(prior_, row)) * likelihood(log_likelihood) *
                       rig::square_root(Row(look.noise_N2 * per));
      weight = rig::select(compares, seen, weight);
    }
    theta_N = rig::select(learns, within(theta_N + gain_theta * residual, theta_least_N_, theta_most_N_), theta_N);
    const Row moved = rig::select(learns, within(zero + gain_zero * residual, zero_least_, zero_most_), zero);
    // What is on its way through the filter was computed with the old zero.
    const Row shift = by_slip[row] * (moved - zero);
    auto&& late = delay_of(m, row);
    late.shift(shift);
    keep(m, row, late);
    zero = moved;
    // Rounding must not make the covariance indefinite.
    theta_variance = rig::select(
        learns, rig::larger(Row(theta_variance_least_N2_), theta_variance - gain_theta * reach_theta), theta_variance);
    zero_variance =
        rig::select(learns, rig::larger(Row(zero_variance_min), zero_variance - gain_zero * reach_zero), zero_variance);
    const Row most = rig::square_root(Row(theta_variance * zero_variance));
    covariance = rig::select(learns, within(covariance - gain_theta * reach_zero, -most, most), covariance);
  }
}

template <class S>
template <class Condition>
void BasicFrictionBank<S>::follow_jump(const Condition& where, const S& dt_s, const S& residual_N) noexcept {
  using namespace friction_bank;
  using friction_curves::square;
  hold_s_ = rig::select(where, S(hold_s_ - dt_s), hold_s_);
  // A force near 0 or below tells nothing of the level.
  const auto seen = where && late_force_N_ > seen_N_;
  if (rig::any(seen)) {
    const S covered = -rig::exponential_less_one(S(-dt_s / options_.jump_time_constant_s));
    const S factor = rig::clamped(S(1.0 + covered * residual_N / late_force_N_), S(largest_fall), S(largest_rise));
    for (Members& m : bank_) {
      for (std::size_t row = 0; row < rows_a_shape; ++row) {
        Row& theta_N = row_of(m.theta_N, row);
        theta_N = rig::select(seen, within(theta_N * factor, theta_least_N_, theta_most_N_), theta_N);
      }
    }
    late_force_N_ = rig::select(seen, S(late_force_N_ * factor), late_force_N_);
  }
  const auto ends = where && !jumping();
  if (!rig::any(ends)) return;
  for (Members& m : bank_) {
    for (std::size_t row = 0; row < rows_a_shape; ++row) {
      Row& variance = row_of(m.theta_variance, row);
      const Row spread_N = options_.jump_spread * row_of(m.theta_N, row);
      variance = rig::select(ends, Row(variance + square(spread_N)), variance);
    }
  }
}

template <class S>
void BasicFrictionBank<S>::watch_for_jumps(const Data& data) noexcept {
  using namespace friction_bank;
  const S residual = data.quick_force_N - late_force_N_;
  if (const auto jumps = jumping(); rig::any(jumps)) follow_jump(jumps, data.dt_s, residual);
  const auto watches = time_s_ > options_.jump_after_s && data.car_speed_m_s > learning_m_s;
  // What an error of the slip does to the force where the curve rises.
  const S by_slip_N = options_.jump_slip_m_s * rig::larger(S(0.0), late_force_N_) /
                      (peak_slip_ * rig::larger(data.car_speed_m_s, S(slip_speed_min_m_s)));
  const auto unexplained =
      rig::magnitude(residual) >
      data.swing.quick_force_N + by_slip_N + rig::larger(options_.jump_least_N, S(options_.jump_share * peak_force_N_));
  unexplained_s_ = rig::select(watches && unexplained, S(unexplained_s_ + data.dt_s), S(0.0));
  const S newest = data.dt_s / (unexplained_lasts_s + data.dt_s);
  unexplained_N_ = rig::select(watches, S(unexplained_N_ + newest * (residual - unexplained_N_)), S(0.0));
  const auto confirmed = unexplained_s_ >= options_.jump_confirm_s;
  hold_s_ = rig::select(confirmed, options_.jump_hold_s, hold_s_);
  unexplained_s_ = rig::select(confirmed, S(0.0), unexplained_s_);
  jumps_ = rig::select(confirmed, S(jumps_ + 1.0), jumps_);
}

template <class S>
void BasicFrictionBank<S>::summarise(const S& runaway_per_N) noexcept {
  using namespace friction_bank;
  Sum weights, slips, costs, runaways, zeros, thetas, forces;
  for (std::size_t row = 0; row < rows_a_shape; ++row) {
    const Row peak = numbers(friction_curves::peak, row);
    const auto is_passed = peak < Row(peak_slip_);
    Row weight(0.0), slip(0.0), cost(0.0), runaway(0.0), zero(0.0), theta(0.0), force(0.0);
    for (std::size_t shape = 0; shape < shapes; ++shape) {
      const Members& m = bank_[shape];
      const Row bent = numbers(friction_curves::derived.bent[shape], row);
      const Row& part = row_of(m.weight, row);
      const Row& theta_N = row_of(m.theta_N, row);
      const Row height = part * theta_N;
      // The slope of the force a tenth past the peak, times what a newton means for the slip.
      const Row runs_away = (past_the_peak * runaway_per_N) * theta_N * bent * peak;
      const Row passed = rig::select(is_passed, Row(options_.past_peak_cost * runs_away), Row(0.0));
      const Row cost_here = part * bent * (1.0 + passed);
      weight = weight + part;
      slip = slip + cost_here * peak;
      cost = cost + cost_here;
      runaway = runaway + part * runs_away;
      zero = zero + part * row_of(m.zero, row);
      theta = theta + height;
      force = force + height * row_of(m.phi.last, row);
    }
    weights.add(row, weight);
    slips.add(row, slip);
    costs.add(row, cost);
    runaways.add(row, runaway);
    zeros.add(row, zero);
    thetas.add(row, theta);
    forces.add(row, force);
  }
  const S per = 1.0 / weights.value();
  for (Members& m : bank_) {
    for (std::size_t row = 0; row < rows_a_shape; ++row) row_of(m.weight, row) *= per;
  }
  peak_slip_ = slips.value() / costs.value();
  runaway_ = per * runaways.value();
  slip_zero_ = per * zeros.value();
  // A mean, but for rounding.
  peak_force_N_ = rig::clamped(S(per * thetas.value()), theta_least_N_, theta_most_N_);
  force_N_ = per * forces.value();
}

template <class S>
CurvePoint<S> BasicFrictionBank<S>::point(const S& slip) const noexcept {
  Sum values, slopes;
  for (std::size_t row = 0; row < rows_a_shape; ++row) {
    Row row_values(0.0), row_slopes(0.0);
    for (std::size_t shape = 0; shape < shapes; ++shape) {
      const Members& m = bank_[shape];
      const Row knee = numbers(friction_curves::derived.knee[shape], row);
      const Row at = slip + row_of(m.zero, row);
      const Row height = row_of(m.weight, row) * row_of(m.theta_N, row);
      row_values = row_values + height * friction_curves::value(shape, knee, at);
      row_slopes = row_slopes + height * friction_curves::slope(shape, knee, at);
    }
    values.add(row, row_values);
    slopes.add(row, row_slopes);
  }
  return {values.value(), slopes.value()};
}

template <class S>
auto BasicFrictionBank<S>::at(const S& slip) const noexcept -> Force {
  using friction_curves::square;
  Sum mean, squares;
  for (std::size_t row = 0; row < rows_a_shape; ++row) {
    Row row_mean(0.0), row_squares(0.0);
    for (std::size_t shape = 0; shape < shapes; ++shape) {
      const Members& m = bank_[shape];
      const Row knee = numbers(friction_curves::derived.knee[shape], row);
      const Row phi = friction_curves::value(shape, knee, Row(slip + row_of(m.zero, row)));
      const Row& weight = row_of(m.weight, row);
      const Row N = row_of(m.theta_N, row) * phi;
      row_mean = row_mean + weight * N;
      row_squares = row_squares + weight * (square(N) + row_of(m.theta_variance, row) * square(phi));
    }
    mean.add(row, row_mean);
    squares.add(row, row_squares);
  }
  const S mean_N = mean.value();
  return {mean_N, rig::square_root(rig::larger(S(0.0), S(squares.value() - square(mean_N))))};
}

}  // namespace abs_hil::control
