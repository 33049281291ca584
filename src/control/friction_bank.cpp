// Makes a bank from its options, and begins a braking with it. friction_bank.hpp has the equations.
#include "control/friction_bank.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {
namespace {

using friction_curves::square;

// What a braking leaves is this part of the mean peak: a peak that is passed costs more, and the mean is some 13 %
// high. Chosen on two draws of combined cases (docs/theory-beyond.md).
constexpr double kept_part = 0.7;

/// Of a peak at a slip whose logarithm is known to a standard deviation, not normalised. The bits of the C library's
/// functions depend on the platform.
double belief(double peak, double median, double spread) noexcept {
  constexpr double least = -700.0;  // below, e^x is no number that the polynomial can give
  const double x = -0.5 * square(rig::logarithm(peak / median) / spread);
  return x > least ? rig::exponential(x) : 0.0;
}

FrictionBankOptions<> scaled(FrictionBankOptions<> options, double force_scale) {
  rig::require_valid(options, "control.adaptive_optimal.");
  for (double* force_N : {&options.level0_N, &options.level_spread_N, &options.jump_least_N}) *force_N *= force_scale;
  options.force_noise_N2_s *= force_scale * force_scale;
  options.zero_error_per_N /= force_scale;
  return options;
}

void set(auto& row, std::size_t j, double value) noexcept { row.v[j / 2][j % 2] = value; }
double number(const auto& row, std::size_t j) noexcept { return row.v[j / 2][j % 2]; }

}  // namespace

template <class S>
BasicFrictionBank<S>::BasicFrictionBank(const FrictionBankOptions<>& o, double rate_Hz, double quick_delay_s,
                                        double force_scale)
    : options_{scaled(o, force_scale)},
      rate_Hz_{rate_Hz},
      quick_delay_s_{quick_delay_s},
      theta_least_N_{friction_bank::theta_min_N * force_scale},
      theta_most_N_{friction_bank::theta_max_N * force_scale},
      theta_variance_least_N2_{friction_bank::theta_variance_min_N2 * force_scale * force_scale},
      seen_N_{friction_bank::seen_N * force_scale} {
  if (!(rate_Hz > 0.0 && quick_delay_s > 0.0)) {
    throw std::invalid_argument("the friction bank needs a control rate and a delay of the quick force > 0");
  }
  double sum = 0.0, last_sum = 0.0;
  Row& prior = prior_;
  Row last(0.0);
  for (std::size_t j = 0; j < peaks; ++j) {
    set(prior, j, belief(friction_curves::peak[j], o.slip0, o.slip_spread));
    if (o.last_peak_slip > 0.0) set(last, j, belief(friction_curves::peak[j], o.last_peak_slip, o.last_peak_spread));
  }
  constexpr std::size_t members = peaks * shapes;
  for (std::size_t i = 0; i < members; ++i) {
    sum += number(prior, i % peaks);
    last_sum += number(last, i % peaks);
  }
  // The rest keeps every member alive: what the last braking has left may be wrong.
  const double part = o.last_peak_part;
  prior = prior / Row(sum);
  if (last_sum > 0.0) prior = (1.0 - part) * prior + last * (part / last_sum);
  reset({.car_speed_m_s = 1.0});
}

template <class S>
void BasicFrictionBank<S>::reset(const Start& start) noexcept {
  using friction_bank::zero_max, friction_bank::zero_move_max;
  const double zero = std::clamp(-start.slip, -zero_max, zero_max);
  const double spread = std::sqrt(square(options_.zero_error_m_s) + square(start.swing_m_s)) / start.car_speed_m_s +
                        options_.zero_error_per_N * std::abs(start.force_N);
  zero_least_ = zero - zero_move_max - spread;
  zero_most_ = zero + zero_move_max + spread;
  for (Members& m : bank_) {
    m.theta_N = options_.level0_N;
    m.zero = zero;
    m.covariance = 0.0;
    m.theta_variance = square(options_.level_spread_N);
    m.zero_variance = square(spread);
    m.weight = prior_;
    m.phi = {};
  }
  late_slip_.settle(start.slip);
  time_s_ = hold_s_ = unexplained_s_ = unexplained_N_ = late_force_N_ = jumps_ = 0.0;
  summarise(0.0);
}

template <class S>
double BasicFrictionBank<S>::learnt_peak_slip() const noexcept {
  double mean = 0.0;
  for (const Members& m : bank_) {
    for (std::size_t j = 0; j < peaks; ++j) mean += number(m.weight, j) * rig::logarithm(friction_curves::peak[j]);
  }
  return kept_part * rig::exponential(mean);
}

template class BasicFrictionBank<double>;

}  // namespace abs_hil::control
