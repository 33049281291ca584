#include "control/friction_bank.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {
namespace {

// The bank: slips of the peak in a geometric row, shape factors in an even one. The plants have 0.03 to 0.25 and 1.27
// to 1.9.
constexpr double least_peak_slip = 0.02;
constexpr double largest_peak_slip = 0.32;
constexpr double least_shape = 1.15;
constexpr double largest_shape = 1.9;
// Bounds of the unknowns.
constexpr double theta_min_N = 6.0;
constexpr double theta_max_N = 500.0;
constexpr double zero_max = 0.025;
constexpr double theta_variance_min_N2 = 1e-9;
constexpr double zero_variance_min = 1e-14;
// The errors of force and slip that are not noise of single cycles last about this long.
constexpr double error_lasts_s = 0.005;
// Slower, the slip is made of few counts.
constexpr double learning_m_s = 1.0;
constexpr double slip_speed_min_m_s = 0.3;
// The level is seen in forces above this.
constexpr double seen_N = 3.0;
constexpr double largest_fall = 0.9;  ///< of the level in a cycle
constexpr double largest_rise = 1.15;
// exp(-30) is as good as 0, and keeps the weights away from numbers that a double cannot hold.
constexpr double log_likelihood_min = -30.0;

constexpr double square(double x) noexcept { return x * x; }

}  // namespace

LowerWheelForce::LowerWheelForce(const rig::WheelParameters& wheels, double bandwidth_rad_s) noexcept
    : wheels_{wheels}, bandwidth_rad_s_{bandwidth_rad_s}, tracker_{{.bandwidth_rad_s = bandwidth_rad_s}, 1} {}

void LowerWheelForce::reset(double omega2_rad_s) noexcept {
  free_rad_s_ = omega2_rad_s;
  tracker_.reset(0.0);
  covered_ = force_N_ = 0.0;
}

void LowerWheelForce::update(double dt_s, double travel_rad, double omega2_rad_s) noexcept {
  const double friction_rad_s2 = -(wheels_.d2_Nms_rad * omega2_rad_s + wheels_.M20_Nm) / wheels_.J2_kg_m2;
  const double free_rad = (free_rad_s_ + 0.5 * friction_rad_s2 * dt_s) * dt_s;
  free_rad_s_ += friction_rad_s2 * dt_s;
  if (dt_s != tracker_.dt_s()) {
    tracker_.prepare(dt_s);
    covered_ = -rig::exponential_less_one(-bandwidth_rad_s_ * dt_s);
  }
  tracker_.correct((travel_rad - free_rad) / tracker_.rad_per_count());
  force_N_ = -wheels_.J2_kg_m2 * tracker_.alpha_rad_s2() / wheels_.r2_m;
}

FrictionBank::FrictionBank(const FrictionBankOptions& options, double rate_Hz, double quick_delay_s)
    : options_{options}, rate_Hz_{rate_Hz}, quick_delay_s_{quick_delay_s} {
  rig::require_valid(options, "control.adaptive_optimal.");
  if (!(rate_Hz > 0.0 && quick_delay_s > 0.0)) {
    throw std::invalid_argument("the friction bank needs a control rate and a delay of the quick force > 0");
  }
  std::array<double, shapes> curvatures{};  // -phi'' at the peak, slip in units of the peak's
  for (std::size_t k = 0; k < shapes; ++k) {
    const double c = least_shape + (largest_shape - least_shape) * static_cast<double>(k) / (shapes - 1);
    const double at_peak = std::tan(std::numbers::pi / (2.0 * c));
    curvatures[k] = square(c * at_peak / (1.0 + square(at_peak)));
    for (std::size_t i = 0; i < table_[k].size(); ++i) {
      const double u = std::min(static_cast<double>(i) / table_steps, 1.0 - 1e-6);
      table_[k][i] = std::sin(c * std::atan(at_peak * u / (1.0 - u)));
    }
  }
  double sum = 0.0;
  for (std::size_t j = 0; j < peaks; ++j) {
    peak_slips_[j] =
        least_peak_slip * std::pow(largest_peak_slip / least_peak_slip, static_cast<double>(j) / (peaks - 1));
    const double away = std::log(peak_slips_[j] / options.slip0) / options.slip_spread;
    for (std::size_t k = 0; k < shapes; ++k) {
      sum += prior_[j * shapes + k] = std::exp(-0.5 * square(away));
      bent_[j * shapes + k] = curvatures[k] / square(peak_slips_[j]);
    }
  }
  for (double& p : prior_) p /= sum;
  reset();
}

void FrictionBank::reset() noexcept {
  for (std::size_t i = 0; i < members; ++i) {
    bank_[i] = {.theta_N = options_.level0_N,
                .zero = 0.0,
                .theta_variance = square(options_.level_spread_N),
                .covariance = 0.0,
                .zero_variance = square(options_.zero_spread),
                .weight = prior_[i],
                .phi = {}};
  }
  late_slip_ = {};
  time_s_ = hold_s_ = unexplained_s_ = late_force_N_ = 0.0;
  jumps_ = 0;
  summarise({});
}

FrictionBank::Point FrictionBank::curve(std::size_t index, double slip) const noexcept {
  const double peak = peak_slips_[index / shapes];
  const auto& table = table_[index % shapes];
  const double size = std::abs(slip);
  const double share = 1.0 / (peak + size);
  const double place = size * share * table_steps;
  const auto i = std::min(static_cast<std::size_t>(place), table_steps);
  const double step = table[i + 1] - table[i];
  const double value = table[i] + (place - static_cast<double>(i)) * step;
  return {std::copysign(value, slip), step * table_steps * peak * share * share};
}

void FrictionBank::learn(const Data& data) noexcept {
  if (!(data.dt_s > 0.0)) return;
  time_s_ += data.dt_s;
  const double late_slip = late_slip_(data.covered, data.slip);
  // The filter of the slip is as late as three lags, so this is its mean rate of late.
  const double slip_rate_per_s = (data.slip - late_slip) * options_.force_bandwidth_rad_s / 3.0;
  watch_for_jumps(data);
  const bool learns = !jumping();
  const bool compares = learns && data.car_speed_m_s > learning_m_s;
  const double starting = time_s_ < options_.start_s ? 1e6 : 1.0;
  const double noise_N2 =
      starting * rate_Hz_ * (options_.force_noise_N2_s + error_lasts_s * square(options_.force_error * data.force_N));
  const double timing = options_.timing_error_s * slip_rate_per_s;
  const double speed = options_.slip_noise_m_s / std::max(data.car_speed_m_s, slip_speed_min_m_s);
  const double slip_error2 = error_lasts_s * rate_Hz_ * (square(timing) + square(speed));
  const double back = options_.share_per_s * data.dt_s;
  std::array<double, members> now{};
  for (std::size_t i = 0; i < members; ++i) {
    Member& m = bank_[i];
    const Point here = curve(i, data.slip + m.zero);
    const double phi = m.phi(data.covered, here.value);
    now[i] = here.value;
    m.theta_variance += options_.level_drift_per_s * data.dt_s * square(m.theta_N);
    m.zero_variance += options_.zero_drift_per_s * data.dt_s;
    if (!learns) continue;
    // The gradient of the force that the member expects, by theta and by the zero.
    const double slope = curve(i, late_slip + m.zero).slope;
    const double by_zero = m.theta_N * slope;
    const double noise = noise_N2 + square(by_zero) * slip_error2;
    const double reach_theta = m.theta_variance * phi + m.covariance * by_zero;
    const double reach_zero = m.covariance * phi + m.zero_variance * by_zero;
    const double variance = std::max(noise, reach_theta * phi + reach_zero * by_zero + noise);
    const double residual = data.force_N - m.theta_N * phi;
    const double per = 1.0 / variance;
    if (compares) {
      m.weight = (m.weight + back * prior_[i]) *
                 rig::exponential(std::max(-0.5 * square(residual) * per, log_likelihood_min)) *
                 std::sqrt(noise_N2 * per);
    }
    m.theta_N = std::clamp(m.theta_N + reach_theta * per * residual, theta_min_N, theta_max_N);
    const double zero = std::clamp(m.zero + reach_zero * per * residual, -zero_max, zero_max);
    // What is on its way through the filter was computed with the old zero.
    m.phi.shift(slope * (zero - m.zero));
    now[i] += here.slope * (zero - m.zero);
    m.zero = zero;
    // Rounding must not make the covariance indefinite.
    m.theta_variance = std::max(theta_variance_min_N2, m.theta_variance - reach_theta * per * reach_theta);
    m.zero_variance = std::max(zero_variance_min, m.zero_variance - reach_zero * per * reach_zero);
    const double most = std::sqrt(m.theta_variance * m.zero_variance);
    m.covariance = std::clamp(m.covariance - reach_theta * per * reach_zero, -most, most);
  }
  summarise(now);
  late_force_N_ += -rig::exponential_less_one(-data.dt_s / quick_delay_s_) * (force_N_ - late_force_N_);
}

void FrictionBank::watch_for_jumps(const Data& data) noexcept {
  const double residual = data.quick_force_N - late_force_N_;
  if (jumping()) {
    hold_s_ -= data.dt_s;
    // A force near 0 or below tells nothing of the level.
    if (late_force_N_ > seen_N) {
      const double covered = -rig::exponential_less_one(-data.dt_s / options_.jump_time_constant_s);
      const double factor = std::clamp(1.0 + covered * residual / late_force_N_, largest_fall, largest_rise);
      for (Member& m : bank_) m.theta_N = std::clamp(m.theta_N * factor, theta_min_N, theta_max_N);
      late_force_N_ *= factor;
    }
    if (!jumping()) {
      for (Member& m : bank_) m.theta_variance += square(options_.jump_spread * m.theta_N);
    }
  }
  const bool watches = time_s_ > options_.jump_after_s && data.car_speed_m_s > learning_m_s;
  const bool unexplained = std::abs(residual) > std::max(options_.jump_least_N, options_.jump_share * peak_force_N_);
  unexplained_s_ = watches && unexplained ? unexplained_s_ + data.dt_s : 0.0;
  if (unexplained_s_ >= options_.jump_confirm_s) {
    hold_s_ = options_.jump_hold_s;
    unexplained_s_ = 0.0;
    ++jumps_;
  }
}

void FrictionBank::summarise(const std::array<double, members>& now) noexcept {
  double sum = 0.0;
  for (const Member& m : bank_) sum += m.weight;
  const double per = 1.0 / sum;
  double slip = 0.0, curvature = 0.0, zero = 0.0, theta = 0.0, force = 0.0;
  for (std::size_t i = 0; i < members; ++i) {
    Member& m = bank_[i];
    m.weight *= per;
    const double bent = m.weight * bent_[i];
    slip += bent * peak_slips_[i / shapes];
    curvature += bent;
    zero += m.weight * m.zero;
    theta += m.weight * m.theta_N;
    force += m.weight * m.theta_N * now[i];
  }
  peak_slip_ = slip / curvature;
  slip_zero_ = zero;
  peak_force_N_ = theta;
  force_N_ = force;
}

FrictionBank::Force FrictionBank::at(double slip) const noexcept {
  double mean = 0.0, square_sum = 0.0;
  for (std::size_t i = 0; i < members; ++i) {
    const Member& m = bank_[i];
    const double phi = curve(i, slip + m.zero).value;
    const double N = m.theta_N * phi;
    mean += m.weight * N;
    square_sum += m.weight * (N * N + m.theta_variance * phi * phi);
  }
  return {mean, std::sqrt(std::max(0.0, square_sum - mean * mean))};
}

}  // namespace abs_hil::control
