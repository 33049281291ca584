// The bank's filters, weights and means. friction_bank.hpp has the equations.
#include "control/friction_bank.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <type_traits>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {
namespace {

// The bank: slips of the peak in a geometric row, shape factors in an even one. The plants have 0.03 to 0.25 and 1.27
// to 1.9.
constexpr double least_peak_slip = 0.02;
constexpr double largest_peak_slip = 0.25;
constexpr double least_shape = 1.15;
constexpr double largest_shape = 1.9;
// Bounds of the unknowns.
constexpr double theta_min_N = 2.0;
constexpr double theta_max_N = 500.0;
constexpr double zero_max = 0.025;
constexpr double theta_variance_min_N2 = 1e-9;
constexpr double zero_variance_min = 1e-14;
// The errors of force and slip that are not noise of single cycles last about this long.
constexpr double error_lasts_s = 0.005;
// Slower, the slip is made of few counts.
constexpr double learning_m_s = 1.0;
constexpr double slip_speed_min_m_s = 0.3;
// What a braking leaves is this part of the mean peak: a peak that is passed costs more, and the mean is some 13 %
// high. Chosen on two draws of combined cases (docs/theory-beyond.md).
constexpr double kept_part = 0.7;
// A slip counts as past a peak by this part of it.
constexpr double past_the_peak = 0.1;
// The level is seen in forces above this.
constexpr double seen_N = 3.0;
constexpr double largest_fall = 0.9;  ///< of the level in a cycle
constexpr double largest_rise = 1.15;
// Friction that changes slowly shows in the mean of the unexplained force over about this time.
constexpr double unexplained_lasts_s = 0.02;
// exp(-30) is as good as 0, and keeps the weights away from numbers that a double cannot hold.
constexpr double log_likelihood_min = -30.0;

template <class S>
[[gnu::always_inline]] inline S square(const S& x) noexcept {
  return x * x;
}

template <class Row>
[[gnu::always_inline]] inline Row within(const Row& x, const std::type_identity_t<Row>& least,
                                         const std::type_identity_t<Row>& most) noexcept {
  return rig::smaller(rig::larger(x, least), most);
}

template <class Row>
[[gnu::always_inline]] inline Row horner(const auto& c, const Row& x) noexcept {
  Row sum = c.back();
  for (std::size_t i = c.size() - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

/// e^x for x in [-30, 0], within 2 % of it, and within 1e-5 above -5: a likelihood need not be exact.
template <class Row>
[[gnu::always_inline]] inline Row likelihood(const Row& x) noexcept {
  const Row t = x * (1.0 / 64.0);
  Row e = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0))));
  for (int i = 0; i < 6; ++i) e = e * e;
  return e;
}

template <class Row>
[[gnu::always_inline]] inline double sum_of(const Row& row) noexcept {
  auto sum = row.v[0];
  for (std::size_t i = 1; i < std::size(row.v); ++i) sum += row.v[i];
  return sum[0] + sum[1];
}

/// Of a peak at a slip whose logarithm is known to a standard deviation, not normalised.
double belief(double peak, double median, double spread) noexcept {
  return std::exp(-0.5 * square(std::log(peak / median) / spread));
}

template <class Row>
void set_lane(Row& row, std::size_t lane, double value) noexcept {
  row.v[lane / rig::Portable::lanes][lane % rig::Portable::lanes] = value;
}

template <class Row>
double lane_of(const Row& row, std::size_t lane) noexcept {
  return row.v[lane / rig::Portable::lanes][lane % rig::Portable::lanes];
}

/// For each C the coefficients of the polynomial in u = B s / (1 + B s) that meets sin(C atan(B s)) / u at the
/// Chebyshev nodes of (0, 1). They are numbers because a solver's rounding depends on the compiler, and every platform
/// computes the same bits.
constexpr std::array<std::array<double, 10>, FrictionBank::shapes> curves{
    {{0x1.266ccf142c2cbp+0, 0x1.216f5725c5018p+0, 0x1.204329cf3fc6dp+0, -0x1.fdee1083627cp+2, 0x1.3477b71ff3cd3p+5,
      -0x1.f1c11634415f9p+6, 0x1.7fb3a7b1bc924p+7, -0x1.23170ca85a028p+7, 0x1.980a58609c7dcp+5, -0x1.796fac91ff7fbp+2},
     {0x1.867653c51eb33p+0, 0x1.7a0a1d8dc779ep+0, 0x1.f714160d4583dp+0, -0x1.4349359013b5p+4, 0x1.9cb2f0fdf044p+6,
      -0x1.54d4d85d30d4cp+8, 0x1.205d725e2fd6bp+9, -0x1.fe061f658e3efp+8, 0x1.c6451b596b1cdp+7, -0x1.42235fd0c3f34p+5},
     {0x1.e687537b974ecp+0, 0x1.ccd046493bb27p+0, 0x1.aa8ba6554ba69p+1, -0x1.52d38b75ba953p+5, 0x1.c07c56891cc48p+7,
      -0x1.79462da21ea11p+9, 0x1.50532cbdd5c16p+10, -0x1.3fbac82564e1bp+10, 0x1.36d1ca7a234ddp+9,
      -0x1.e8f3987e65308p+6}}};

}  // namespace

FrictionBank::FrictionBank(const FrictionBankOptions& options, double rate_Hz, double quick_delay_s)
    : options_{options}, rate_Hz_{rate_Hz}, quick_delay_s_{quick_delay_s} {
  rig::require_valid(options, "control.adaptive_optimal.");
  if (!(rate_Hz > 0.0 && quick_delay_s > 0.0)) {
    throw std::invalid_argument("the friction bank needs a control rate and a delay of the quick force > 0");
  }
  double sum = 0.0, last_sum = 0.0;
  std::array<Row, rows> last{};
  for (std::size_t k = 0; k < shapes; ++k) {
    const double c = least_shape + (largest_shape - least_shape) * static_cast<double>(k) / (shapes - 1);
    const double at_peak = std::tan(std::numbers::pi / (2.0 * c));
    const double curvature = square(c * at_peak / (1.0 + square(at_peak)));  // slip in units of the peak's
    Shape& shape = shapes_[k];
    shape.value = curves[k];
    for (std::size_t i = 0; i < terms; ++i) shape.slope[i] = static_cast<double>(i + 1) * shape.value[i];
    for (std::size_t j = 0; j < peaks; ++j) {
      const double peak =
          least_peak_slip * std::pow(largest_peak_slip / least_peak_slip, static_cast<double>(j) / (peaks - 1));
      const double prior = belief(peak, options.slip0, options.slip_spread);
      const double after =
          options.last_peak_slip > 0.0 ? belief(peak, options.last_peak_slip, options.last_peak_spread) : 0.0;
      sum += prior;
      last_sum += after;
      Members& m = bank_[k * rows_a_shape + j / Row::lanes];
      const std::size_t lane = j % Row::lanes;
      set_lane(m.peak, lane, peak);
      set_lane(m.knee, lane, peak / at_peak);
      set_lane(m.bent, lane, curvature / square(peak));
      set_lane(m.prior, lane, prior);
      set_lane(last[k * rows_a_shape + j / Row::lanes], lane, after);
    }
  }
  for (Members& m : bank_) m.prior = m.prior / Row(sum);
  // The rest keeps every member alive: what the last braking has left may be wrong.
  const double part = options.last_peak_part;
  for (std::size_t i = 0; last_sum > 0.0 && i < rows; ++i) {
    bank_[i].prior = (1.0 - part) * bank_[i].prior + last[i] * (part / last_sum);
  }
  reset({.car_speed_m_s = 1.0});
}

void FrictionBank::reset(const Start& start) noexcept {
  const double zero = std::clamp(-start.slip, -zero_max, zero_max);
  const double spread = std::hypot(options_.zero_error_m_s, start.swing_m_s) / start.car_speed_m_s +
                        options_.zero_error_per_N * std::abs(start.force_N);
  for (Members& m : bank_) {
    m.theta_N = options_.level0_N;
    m.zero = zero;
    m.covariance = m.now = 0.0;
    m.theta_variance = square(options_.level_spread_N);
    m.zero_variance = square(spread);
    m.weight = m.prior;
    m.phi = {};
  }
  late_slip_.settle(start.slip);
  time_s_ = hold_s_ = unexplained_s_ = unexplained_N_ = late_force_N_ = 0.0;
  jumps_ = 0;
  summarise(0.0);
}

auto FrictionBank::value(const Shape& shape, const Row& knee, const Row& slip) noexcept -> Row {
  const Row size = rig::magnitude(slip);
  const Row u = size / (knee + size);
  return rig::with_sign(u * horner(shape.value, u), slip);
}

/// Over the slip.
auto FrictionBank::slope(const Shape& shape, const Row& knee, const Row& slip) noexcept -> Row {
  const Row size = rig::magnitude(slip);
  const Row share = 1.0 / (knee + size);
  return horner(shape.slope, size * share) * knee * share * share;
}

void FrictionBank::learn(const Data& data) noexcept {
  if (!(data.dt_s > 0.0)) return;
  time_s_ += data.dt_s;
  const double late_reading = late_slip_(data.covered, data.slip);
  // The filter of the slip is as late as three lags, so this is its mean rate of late.
  const double slip_rate_per_s = (data.slip - data.late_slip) * options_.force_bandwidth_rad_s / 3.0;
  watch_for_jumps(data);
  const bool learns = !jumping();
  const double starting = time_s_ < options_.start_s ? 1e6 : 1.0;
  const double timing = options_.timing_error_s * slip_rate_per_s;
  const double speed = std::sqrt(square(options_.slip_noise_m_s) + square(data.swing.speed_m_s)) /
                       std::max(data.car_speed_m_s, slip_speed_min_m_s);
  const Look look{
      .slip = data.slip,
      .late_slip = data.late_slip,
      .covered = data.covered,
      .slip_offset = late_reading - data.late_slip,
      .force_N = data.force_N,
      .noise_N2 = starting * rate_Hz_ *
                  (options_.force_noise_N2_s +
                   error_lasts_s * (square(options_.force_error * data.force_N) + 0.5 * square(data.swing.force_N))),
      .slip_error2 = error_lasts_s * rate_Hz_ * (square(timing) + square(speed)),
      .theta_growth = data.dt_s * (options_.level_drift_per_s +
                                   options_.level_drift_unexplained_per_s * square(unexplained_N_ / peak_force_N_)),
      .zero_growth = options_.zero_drift_per_s * data.dt_s,
      .back = options_.share_per_s * data.dt_s,
      .learns = learns,
      .compares = learns && data.car_speed_m_s > learning_m_s};
  for (std::size_t i = 0; i < rows; ++i) learn(shapes_[i / rows_a_shape], look, bank_[i]);
  summarise(data.runaway_per_N);
  late_force_N_ += -rig::exponential_less_one(-data.dt_s / quick_delay_s_) * (force_N_ - late_force_N_);
}

void FrictionBank::learn(const Shape& shape, const Look& look, Members& m) noexcept {
  m.now = value(shape, m.knee, look.slip + m.zero);
  const Row delayed = m.phi(look.covered, m.now);
  m.theta_variance = m.theta_variance + look.theta_growth * square(m.theta_N);
  m.zero_variance = m.zero_variance + look.zero_growth;
  if (!look.learns) return;
  // The gradient of the force that the member expects, by theta and by the zero.
  const Row by_slip = slope(shape, m.knee, look.late_slip + m.zero);
  const Row phi = delayed - by_slip * look.slip_offset;
  const Row by_zero = m.theta_N * by_slip;
  const Row noise = look.noise_N2 + square(by_zero) * look.slip_error2;
  const Row reach_theta = m.theta_variance * phi + m.covariance * by_zero;
  const Row reach_zero = m.covariance * phi + m.zero_variance * by_zero;
  const Row per = 1.0 / rig::larger(noise, reach_theta * phi + reach_zero * by_zero + noise);
  const Row residual = look.force_N - m.theta_N * phi;
  const Row gain_theta = reach_theta * per, gain_zero = reach_zero * per;
  if (look.compares) {
    const Row log_likelihood = rig::larger(Row(log_likelihood_min), square(residual) * (-0.5 * per));
    m.weight = (m.weight + look.back * m.prior) * likelihood(log_likelihood) * rig::square_root(look.noise_N2 * per);
  }
  m.theta_N = within(m.theta_N + gain_theta * residual, theta_min_N, theta_max_N);
  const Row zero = within(m.zero + gain_zero * residual, -zero_max, zero_max);
  // What is on its way through the filter was computed with the old zero.
  const Row shift = by_slip * (zero - m.zero);
  m.phi.shift(shift);
  m.now = m.now + shift;
  m.zero = zero;
  // Rounding must not make the covariance indefinite.
  m.theta_variance = rig::larger(Row(theta_variance_min_N2), m.theta_variance - gain_theta * reach_theta);
  m.zero_variance = rig::larger(Row(zero_variance_min), m.zero_variance - gain_zero * reach_zero);
  const Row most = rig::square_root(m.theta_variance * m.zero_variance);
  m.covariance = within(m.covariance - gain_theta * reach_zero, -most, most);
}

void FrictionBank::watch_for_jumps(const Data& data) noexcept {
  const double residual = data.quick_force_N - late_force_N_;
  if (jumping()) {
    hold_s_ -= data.dt_s;
    // A force near 0 or below tells nothing of the level.
    if (late_force_N_ > seen_N) {
      const double covered = -rig::exponential_less_one(-data.dt_s / options_.jump_time_constant_s);
      const double factor = std::clamp(1.0 + covered * residual / late_force_N_, largest_fall, largest_rise);
      for (Members& m : bank_) m.theta_N = within(m.theta_N * factor, theta_min_N, theta_max_N);
      late_force_N_ *= factor;
    }
    if (!jumping()) {
      for (Members& m : bank_) m.theta_variance = m.theta_variance + square(options_.jump_spread * m.theta_N);
    }
  }
  const bool watches = time_s_ > options_.jump_after_s && data.car_speed_m_s > learning_m_s;
  const bool unexplained =
      std::abs(residual) >
      data.swing.quick_force_N + std::max(options_.jump_least_N, options_.jump_share * peak_force_N_);
  unexplained_s_ = watches && unexplained ? unexplained_s_ + data.dt_s : 0.0;
  const double newest = data.dt_s / (unexplained_lasts_s + data.dt_s);
  unexplained_N_ = watches ? unexplained_N_ + newest * (residual - unexplained_N_) : 0.0;
  if (unexplained_s_ >= options_.jump_confirm_s) {
    hold_s_ = options_.jump_hold_s;
    unexplained_s_ = 0.0;
    ++jumps_;
  }
}

void FrictionBank::summarise(double runaway_per_N) noexcept {
  Row weight(0.0), slip(0.0), cost(0.0), runaway(0.0), zero(0.0), theta(0.0), force(0.0);
  for (const Members& m : bank_) {
    const Row height = m.weight * m.theta_N;
    // The slope of the force a tenth past the peak, times what a newton means for the slip.
    const Row runs_away = (past_the_peak * runaway_per_N) * m.theta_N * m.bent * m.peak;
    const Row passed = rig::select(m.peak < Row(peak_slip_), options_.past_peak_cost * runs_away, Row(0.0));
    const Row costs = m.weight * m.bent * (1.0 + passed);
    weight = weight + m.weight;
    slip = slip + costs * m.peak;
    cost = cost + costs;
    runaway = runaway + m.weight * runs_away;
    zero = zero + m.weight * m.zero;
    theta = theta + height;
    force = force + height * m.now;
  }
  const double per = 1.0 / sum_of(weight);
  for (Members& m : bank_) m.weight = m.weight * per;
  peak_slip_ = sum_of(slip) / sum_of(cost);
  runaway_ = per * sum_of(runaway);
  slip_zero_ = per * sum_of(zero);
  peak_force_N_ = std::clamp(per * sum_of(theta), theta_min_N, theta_max_N);  // a mean, but for rounding
  force_N_ = per * sum_of(force);
}

double FrictionBank::learnt_peak_slip() const noexcept {
  double mean = 0.0;
  for (const Members& m : bank_) {
    for (std::size_t lane = 0; lane < Row::lanes; ++lane)
      mean += lane_of(m.weight, lane) * std::log(lane_of(m.peak, lane));
  }
  return kept_part * std::exp(mean);
}

FrictionBank::Force FrictionBank::at(double slip) const noexcept {
  Row mean(0.0), squares(0.0);
  for (std::size_t i = 0; i < rows; ++i) {
    const Members& m = bank_[i];
    const Row phi = value(shapes_[i / rows_a_shape], m.knee, slip + m.zero);
    const Row N = m.theta_N * phi;
    mean = mean + m.weight * N;
    squares = squares + m.weight * (square(N) + m.theta_variance * square(phi));
  }
  const double mean_N = sum_of(mean);
  return {mean_N, std::sqrt(std::max(0.0, sum_of(squares) - square(mean_N)))};
}

}  // namespace abs_hil::control
