// The loop of adaptive-optimal: learns the curve, chooses the slip, computes the torque (docs/theory-beyond.md).
#include "control/adaptive_optimal_controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/classic_controllers.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {
namespace {

constexpr double least_hold_Nm = 0.05;  ///< the limits below need a torque that can still fall
constexpr double least_room_Nm = 0.2;   ///< the same for a torque near the brake's largest
constexpr double usual_hold_Nm = 1.0;   ///< before a force is seen
// The force at the peak is taken as known up to the first relative spread, as unknown from the second on.
constexpr double known_spread = 0.15;
constexpr double unknown_spread = 0.4;
// The curve is learnt about this often, however short the cycles are: more readings of the same counts say no more.
constexpr double learning_rate_Hz = 1000.0;
/// Part of a swing once a turn that the observer's force shows.
constexpr double quick_passes = 0.5;

const AdaptiveOptimalOptions& checked(const AdaptiveOptimalOptions& o) {
  rig::require_valid(o, "control.adaptive_optimal.");
  if (!(o.slip_min < o.slip_max)) {
    throw std::invalid_argument("control.adaptive_optimal.slip_min must be below control.adaptive_optimal.slip_max");
  }
  if (!(o.slip_start >= o.slip_min && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.adaptive_optimal.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

/// Coarser counts make the force, the first speeds and the loop noisier. The powers were chosen with the gains
/// (docs/theory-beyond.md).
AdaptiveOptimalOptions counted(AdaptiveOptimalOptions options, const rig::RigParameters& rig) {
  constexpr double usual_counts_per_rev = 4096.0;
  constexpr double most_search_part = 0.5;
  const double coarser = usual_counts_per_rev / rig.encoder_counts_per_rev;
  options.bank.force_noise_N2_s *= coarser * std::sqrt(std::sqrt(coarser));
  options.bank.zero_error_m_s *= coarser;
  if (coarser > 1.0) {
    options.bank.jump_least_N *= std::sqrt(coarser);
    options.play_Nm *= std::sqrt(coarser);
    options.search_part = std::min(most_search_part, options.search_part * std::sqrt(coarser));
  }
  return options;
}

ProximateTorque loop(const AdaptiveOptimalOptions& o, const rig::RigParameters& rig) noexcept {
  const double limit = rig.brake.brake_rate_limit_Nm_s;
  return {.mass_kg_m = rig.wheels.J1_kg_m2 / rig.wheels.r1_m,
          .gain_per_s = o.slip_gain_per_s,
          .near_m_s = o.slip_near_m_s,
          .swing_per_s = rig.brake.c31_per_s,
          .rate_limit_Nm_s = limit > 0.0 ? limit : std::numeric_limits<double>::infinity()};
}

}  // namespace

AdaptiveOptimalController::AdaptiveOptimalController(const ControllerContext& context)
    : options_{counted(checked(context.options.adaptive_optimal), context.rig)},
      rig_{context.rig},
      laws_{paper::laws(context.rig.wheels)},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      period_s_{1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      loop_{loop(options_, context.rig)},
      observer_{options_.observer, context.rig, context.options.rate_Hz},
      force_{context.rig.wheels, options_.bank.force_bandwidth_rad_s},
      learns_every_{std::max(1, static_cast<int>(std::lround(context.options.rate_Hz / learning_rate_Hz)))},
      bank_{options_.bank, context.options.rate_Hz / learns_every_, observer_.force_delay_s()} {}

void AdaptiveOptimalController::reset(const SlipInput& input) noexcept {
  observer_.reset(input.speeds);
  force_.reset(input.speeds.omega2_rad_s);
  const double turning_Nm = rig_.wheels.J1_kg_m2 * input.alpha1_rad_s2 +
                            rig_.wheels.d1_Nms_rad * input.speeds.omega1_rad_s + rig_.wheels.M10_Nm;
  bank_.reset({.slip = slip_of(input.speeds),
               .car_speed_m_s = std::max(rig_.wheels.r2_m * input.speeds.omega2_rad_s, v_min_m_s_),
               .force_N = (turning_Nm + input.brake_torque_Nm) / rig_.wheels.r1_m,
               .swing_m_s = swing(input.disc_error_rad, input.speeds.omega2_rad_s).speed_m_s});
  speeds_.reset(input.speeds);
  reference_ = options_.slip_start;
  model_error_Nm_ = sent_Nm_ = search_rad_ = 0.0;
  last_speeds_ = input.speeds;
  unlearnt_ = {};
}

double AdaptiveOptimalController::slip_of(const rig::WheelSpeeds& speeds) const noexcept {
  return rig::wheel_slip(rig_.wheels.r1_m * speeds.omega1_rad_s, rig_.wheels.r2_m * speeds.omega2_rad_s, v_min_m_s_);
}

/// An angle that swings by e once a turn looks like an acceleration that swings by e omega^2. The lags of the force
/// pass less of it.
FrictionBank::Swing AdaptiveOptimalController::swing(double disc_error_rad, double omega_rad_s) const noexcept {
  if (!(disc_error_rad > 0.0)) return {};
  const double force_N = rig_.wheels.J2_kg_m2 * disc_error_rad * omega_rad_s * omega_rad_s / rig_.wheels.r2_m;
  const double ratio = omega_rad_s / options_.bank.force_bandwidth_rad_s;
  const double one_lag = 1.0 / std::sqrt(1.0 + ratio * ratio);
  return {.force_N = force_N * one_lag * one_lag * one_lag,
          .quick_force_N = quick_passes * force_N,
          .speed_m_s = rig_.wheels.r2_m * disc_error_rad * omega_rad_s};
}

void AdaptiveOptimalController::learn(const SlipInput& input, double slip) noexcept {
  if (!(input.dt_s > 0.0)) return;
  const auto travel_rad = [&](double known_rad, double last_rad_s, double rad_s) {
    return std::isnan(known_rad) ? 0.5 * (last_rad_s + rad_s) * input.dt_s : known_rad;
  };
  const rig::WheelSpeeds last = std::exchange(last_speeds_, input.speeds);
  unlearnt_.upper_rad += travel_rad(input.upper_travel_rad, last.omega1_rad_s, input.speeds.omega1_rad_s);
  unlearnt_.lower_rad += travel_rad(input.lower_travel_rad, last.omega2_rad_s, input.speeds.omega2_rad_s);
  unlearnt_.time_s += input.dt_s;
  if (++unlearnt_.cycles < learns_every_) return;
  const Unlearnt step = std::exchange(unlearnt_, {});
  const double omega2_est = observer_.speeds().omega2_rad_s;
  const double v_x = std::max(rig_.wheels.r2_m * omega2_est, v_min_m_s_);
  force_.update(step.time_s, step.lower_rad, omega2_est);
  speeds_.update(force_.covered(), step.time_s, step.upper_rad, step.lower_rad);
  bank_.learn({.dt_s = step.time_s,
               .slip = slip,
               .late_slip = slip_of(speeds_.speeds()),
               .car_speed_m_s = rig_.wheels.r2_m * omega2_est,
               .force_N = force_.force_N(),
               .covered = force_.covered(),
               .quick_force_N = observer_.force_N(),
               .swing = swing(input.disc_error_rad, omega2_est),
               .runaway_per_N = rig_.wheels.r1_m / (loop_.mass_kg_m * v_x * rig_.brake.c31_per_s)});
  // The balance of both wheels, against that of the curve at the same slip.
  const paper::Reading<double> same{.omega1 = 0.0, .omega2 = 0.0, .lambda_ref = 0.0, .phi = 1.0};
  const double missing_Nm =
      laws_.T_b(laws_.k(same) * (observer_.force_N() - bank_.late_force_N())) - observer_.brake_error_Nm();
  const double covered = -rig::exponential_less_one(-options_.model_error_per_s * step.time_s);
  model_error_Nm_ += covered * (missing_Nm - model_error_Nm_);
}

/// If the slip runs away within the time that the brake takes to act, the reference must not be past the peak, whatever
/// is expected of it.
double AdaptiveOptimalController::peak_factor() const noexcept {
  constexpr double least = 0.75;
  return std::max(least, 1.0 + (options_.peak_factor - 1.0) * (1.0 - bank_.runaway() / options_.runaway));
}

double AdaptiveOptimalController::next_reference(double dt_s) noexcept {
  const double target = std::clamp(peak_factor() * bank_.peak_slip(), options_.slip_min, options_.slip_max);
  // A peak that turns out to be near must not be passed: only a rise takes time.
  reference_ = std::min(target, reference_ * rig::exponential(options_.slip_rate_per_s * dt_s));
  search_rad_ = within_half_turn_rad(search_rad_ + options_.search_rad_s * dt_s);
  const double search = options_.search_part * rig::sine(search_rad_);
  return reference_ * (1.0 + search) - bank_.slip_zero();
}

double AdaptiveOptimalController::holding_torque_Nm(const rig::WheelSpeeds& speeds, double slip,
                                                    double force_N) const noexcept {
  const paper::Reading<double> reading{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = slip, .phi = 1.0};
  return std::max(least_hold_Nm, laws_.T_b(laws_.xi_1(reading, 0.0, force_N)) + model_error_Nm_);
}

AdaptiveOptimalController::Holding AdaptiveOptimalController::holding(double slip, double reference,
                                                                      double error_m_s) const noexcept {
  const rig::WheelSpeeds speeds = observer_.speeds();
  const FrictionBank::Force wanted = bank_.at(reference);
  const double here_N = bank_.force_N();
  const double wanted_Nm = holding_torque_Nm(speeds, reference, wanted.N);
  if (error_m_s > 0.0) {
    // Past the peak the force falls as the slip grows: the torque has to fall below what holds the slip there.
    return {wanted_Nm, here_N < wanted.N ? holding_torque_Nm(speeds, slip, here_N) : wanted_Nm};
  }
  // Before the peak is known: dare an excess that costs no more than `bold_slip` if the peak is here, and dare at least
  // that if nothing is known.
  const double here_Nm = holding_torque_Nm(speeds, slip, std::max(0.0, here_N));
  const double v_x = std::max(rig_.wheels.r2_m * speeds.omega2_rad_s, v_min_m_s_);
  const double bold_Nm = std::sqrt(2.0 * options_.bold_slip * v_x * loop_.mass_kg_m * loop_.swing_per_s *
                                   std::max(here_Nm, usual_hold_Nm));
  // A spread that moves the torque by less than the play counts as known, however small the force is.
  const double least_N = options_.play_Nm / (known_spread * rig_.wheels.r1_m);
  const double spread = wanted.N > 0.0 ? wanted.spread_N / std::max(wanted.N, least_N) : unknown_spread;
  const double unknown = std::clamp((spread - known_spread) / (unknown_spread - known_spread), 0.0, 1.0);
  const double dared_Nm = std::clamp(wanted_Nm, here_Nm + unknown * bold_Nm, here_Nm + bold_Nm);
  return {dared_Nm, dared_Nm};
}

/// The brake catches a slip that runs away only if it answers faster, also while the error is small.
double AdaptiveOptimalController::near_gain_per_s() const noexcept {
  const double runaway_per_s = bank_.runaway() * rig_.brake.c31_per_s;
  return std::min(std::max(options_.slip_gain_per_s, options_.slip_gain_near_per_s),
                  options_.slip_gain_near_per_s + options_.slip_gain_runaway * runaway_per_s);
}

double AdaptiveOptimalController::wanted_torque_Nm(const Holding& hold, double error_m_s,
                                                   double most_Nm) const noexcept {
  const double size = std::abs(error_m_s);
  if (error_m_s < 0.0) return hold.wanted_Nm + loop_.excess_Nm(size, hold.wanted_Nm, options_.authority);
  const auto below = [&](double torque_Nm, double authority) {
    return torque_Nm - loop_.excess_Nm(size, std::max(least_room_Nm, most_Nm - torque_Nm), authority);
  };
  return std::min(below(hold.wanted_Nm, options_.authority), below(hold.here_Nm, options_.authority_past_peak));
}

double AdaptiveOptimalController::through_lag_Nm(double torque_Nm, double wanted_Nm) const noexcept {
  const double error_Nm = wanted_Nm - torque_Nm;
  const double size = std::abs(error_Nm);
  const double near = options_.torque_gain_near_per_s;
  const double gain = near + (options_.torque_gain_per_s - near) * size / (size + options_.torque_near_Nm);
  return lag_.command_Nm(torque_Nm, -rig::exponential_less_one(-gain * period_s_) * error_Nm);
}

double AdaptiveOptimalController::with_play_Nm(double torque_Nm, double most_Nm) noexcept {
  if (torque_Nm <= 0.0 || torque_Nm >= most_Nm) return sent_Nm_ = std::clamp(torque_Nm, 0.0, most_Nm);
  return sent_Nm_ = std::clamp(sent_Nm_, std::max(0.0, torque_Nm - options_.play_Nm),
                               std::min(most_Nm, torque_Nm + options_.play_Nm));
}

SlipOutput AdaptiveOptimalController::step(const SlipInput& input) noexcept {
  observer_.update(input);
  const rig::WheelSpeeds speeds = observer_.speeds();
  const double slip = slip_of(speeds);
  learn(input, slip);
  loop_.near_per_s = near_gain_per_s();
  const double reference = next_reference(input.dt_s);
  const double error_m_s = slip_velocity_error_m_s(rig_.wheels, speeds, reference);
  const double most_Nm = full_torque_Nm(rig_.brake, input.max_brake_torque_Nm);
  const double wanted_Nm = wanted_torque_Nm(holding(slip, reference, error_m_s), error_m_s, most_Nm);
  const bool ideal = std::isinf(input.max_brake_torque_Nm);
  const double command_Nm = ideal ? wanted_Nm : through_lag_Nm(input.brake_torque_Nm, wanted_Nm);
  SlipOutput output{.brake_torque_Nm = with_play_Nm(command_Nm, most_Nm),
                    .slip_velocity_error_m_s = error_m_s,
                    .theta_est_N = bank_.peak_force_N(),
                    .slip_ref = reference};
  output.signals[0] = bank_.peak_slip();
  output.signals[1] = bank_.slip_zero();
  output.signals[2] = bank_.jumps();
  return output;
}

std::span<const rig::Signal> AdaptiveOptimalController::signals() const noexcept {
  static constexpr std::array<rig::Signal, 3> rows{{
      {"peak_slip", "estimated slip of the largest tyre force"},
      {"slip_zero", "estimated error of the slip: the true one less the one that is read"},
      {"friction_jumps", "jumps of friction seen since braking began"},
  }};
  return rows;
}

std::vector<Learnt> AdaptiveOptimalController::learnt() const {
  return {{"control.adaptive_optimal.last_peak_slip", bank_.learnt_peak_slip()}};
}

bool AdaptiveOptimalController::exchange_state(rig::StateBytes& state) {
  state(observer_, force_, speeds_, bank_, reference_, model_error_Nm_, sent_Nm_, search_rad_, last_speeds_, unlearnt_);
  return true;
}

}  // namespace abs_hil::control
