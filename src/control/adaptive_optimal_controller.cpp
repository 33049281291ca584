// Makes adaptive-optimal from its options, and begins a braking with it (docs/theory-beyond.md).
#include "control/adaptive_optimal_controller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "control/adaptive_gains.hpp"
#include "control/wheel_force_observer.hpp"

namespace abs_hil::control {
namespace {

// The curve is learnt about this often, however short the cycles are: more readings of the same counts say no more.
constexpr double learning_rate_Hz = 1000.0;

/// Amplitude of the early search with coarse counts, as a part of the reference.
constexpr double coarse_early_part = 0.5;

/// How much coarser the counts are than those of 4096 a turn.
double coarseness(const rig::RigParameters& rig) noexcept { return 4096.0 / rig.encoder_counts_per_rev; }

/// Coarser counts make the force, the first speeds and the loop noisier, and show the peak later. The powers were
/// chosen with the gains (docs/theory-beyond.md).
AdaptiveOptimalOptions<> counted(AdaptiveOptimalOptions<> options, double coarser) {
  constexpr double most_search_part = 0.5;
  constexpr double least_start = 0.65;
  options.bank.force_noise_N2_s *= coarser * std::sqrt(std::sqrt(coarser));
  options.bank.zero_error_m_s *= coarser;
  if (coarser > 1.0) {
    options.bank.jump_least_N *= std::sqrt(coarser);
    options.bank.jump_slip_m_s *= std::sqrt(coarser);
    options.play_Nm *= std::sqrt(coarser);
    options.slip_start *= std::max(least_start, 1.0 / std::sqrt(coarser));
    options.search_part = std::min(most_search_part, options.search_part * std::sqrt(coarser));
  }
  return options;
}

/// The torques of the options, for a rig whose forces are larger or smaller than those of the paper's.
AdaptiveOptimalOptions<> scaled(AdaptiveOptimalOptions<> options, const RigScale& scale) {
  options.play_Nm *= scale.torque;
  options.torque_near_Nm *= scale.torque;
  return options;
}

AdaptiveOptimalOptions<> delayed(AdaptiveOptimalOptions<> options, double dead_time_s) {
  const PredictedGains most = predicted_gains(dead_time_s);
  options.slip_gain_per_s = std::min(options.slip_gain_per_s, most.slip_most_per_s);
  options.torque_gain_per_s = std::min(options.torque_gain_per_s, most.torque_most_per_s);
  return options;
}

ProximateTorque loop(const AdaptiveOptimalOptions<>& o, const rig::RigParameters& rig) noexcept {
  const double limit = rig.brake.brake_rate_limit_Nm_s;
  return {.mass_kg_m = rig.wheels.J1_kg_m2 / rig.wheels.r1_m,
          .gain_per_s = o.slip_gain_per_s,
          .near_m_s = o.slip_near_m_s,
          .swing_per_s = rig.brake.c31_per_s,
          .rate_limit_Nm_s = limit > 0.0 ? limit : std::numeric_limits<double>::infinity()};
}

}  // namespace

template <class S>
AdaptiveOptimalLaw<S>::AdaptiveOptimalLaw(const ControllerContext& context)
    : options_{delayed(counted(scaled(with_sound_slips(context.options.adaptive_optimal, "control.adaptive_optimal."),
                                      rig_scale(context.rig.wheels)),
                               coarseness(context.rig)),
                       context.rig.brake.brake_dead_time_s)},
      laws_{paper::laws(context.rig.wheels)},
      brake_{context.rig.brake},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      predictor_{context.rig, context.options.v_min_m_s},
      dead_time_s_{context.rig.brake.brake_dead_time_s},
      torque_scale_{rig_scale(context.rig.wheels).torque},
      period_s_{1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      loop_{loop(options_, context.rig)},
      observer_{options_.observer, context.rig, context.options.rate_Hz},
      force_{context.rig.wheels, options_.bank.force_bandwidth_rad_s},
      early_part_{coarseness(context.rig) > 1.0 ? coarse_early_part : 0.0},
      learns_every_{std::max(1.0, std::round(context.options.rate_Hz / learning_rate_Hz))},
      bank_{options_.bank, context.options.rate_Hz / learns_every_, observer_.force_delay_s(),
            rig_scale(context.rig.wheels).force} {}

template <class S>
void AdaptiveOptimalLaw<S>::reset(const BasicSlipInput<S>& input) noexcept {
  observer_.reset(input.speeds);
  force_.reset(input.speeds.omega2_rad_s);
  const double turning_Nm = laws_.J1 * input.alpha1_rad_s2 + laws_.d1 * input.speeds.omega1_rad_s + laws_.M10;
  bank_.reset({.slip = slip_of(input.speeds),
               .car_speed_m_s = std::max(laws_.r2 * input.speeds.omega2_rad_s, v_min_m_s_),
               .force_N = (turning_Nm + input.brake_torque_Nm) / laws_.r1,
               .swing_m_s = swing(input.disc_error_rad, input.speeds.omega2_rad_s).speed_m_s});
  speeds_.reset(input.speeds);
  reference_ = options_.slip_start;
  model_error_Nm_ = sent_Nm_ = search_rad_ = braked_s_ = 0.0;
  last_speeds_ = input.speeds;
  unlearnt_ = {};
}

template class AdaptiveOptimalLaw<double>;

}  // namespace abs_hil::control
