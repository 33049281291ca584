// Rolls while both wheels turn on an even road, slides to the next event otherwise.
#include <algorithm>
#include <cmath>

#include "plant_sim/runge_kutta.hpp"
#include "plant_sim/torque_balance.hpp"

namespace abs_hil::plant_sim {
namespace {

double sign_of(double value) noexcept { return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0; }

/// Torque on the standing upper wheel without friction, N m.
double pull_on_upper_Nm(const WheelModel& model, double force_N) noexcept { return model.wheels().r1_m * force_N; }

/// Torque on the standing lower wheel without friction, N m.
double pull_on_lower_Nm(const WheelModel& model, const HeldTorques& held, double force_N) noexcept {
  return motor_torque_Nm(held, 0.0) - model.wheels().r2_m * force_N;
}

/// Largest friction torque on the standing upper wheel, N m: bearing and brake.
double hold_of_upper_Nm(const TorqueBalance& balance, const StateVector& x) noexcept {
  return balance.model.wheels().M10_Nm + acting_brake_Nm(balance.held, x);
}

double direction(double speed_rad_s, double pull_Nm, double hold_Nm) noexcept {
  if (speed_rad_s != 0.0) return sign_of(speed_rad_s);
  return std::abs(pull_Nm) <= hold_Nm ? 0.0 : sign_of(pull_Nm);
}

/// If a wheel breaks away and is held again within this time, the torque on it equalled its friction within rounding.
constexpr double least_slide_s = 1e-6;
/// Bisections of the interval that contains a stop or break-away: down to 10^-12 of the substep.
constexpr int event_bisections = 40;

/// Bound on the rate of the slip dynamics, which increases as the car slows down. A held wheel has none.
double fastest_rate_per_s(const TorqueBalance& balance, const StateVector& x) noexcept {
  const BasicWheels<double> w(balance.model.wheels());
  const Sliding& sliding = balance.sliding;
  const double mobility_per_kg =
      (sliding.upper != 0.0 ? w.r1_m * w.r1_per_J1 : 0.0) + (sliding.lower != 0.0 ? w.r2_m * w.r2_per_J2 : 0.0);
  const ContactState steepest{x[omega1], x[omega2], acting_brake_Nm(balance.held, x), sliding.upper,
                              balance.friction.highest};
  return balance.model.damping_bound_Ns_m(steepest) * mobility_per_kg;
}

/// Shortest step, within 10^-12 of `step_s`, after which `margin` is negative. It must be negative after `step_s`.
double event_step_s(const TorqueBalance& balance, const StateVector& x, double step_s) noexcept {
  double before_s = 0.0;
  double after_s = step_s;
  for (int i = 0; i < event_bisections; ++i) {
    const double middle_s = 0.5 * (before_s + after_s);
    const StateVector middle = runge_kutta_step(balance, x, middle_s);
    (margin(balance, middle, middle_s) < 0.0 ? after_s : before_s) = middle_s;
  }
  return after_s;
}

/// Both wheels stand: only the brake's lag (6) continues, in closed form. Its rate stays at the limit until the
/// distance to the target has shrunk to what the lag alone covers at that rate.
void stand(const HeldTorques& held, double duration_s, StateVector& x) noexcept {
  double lag_s = duration_s;
  const double distance_Nm = held.brake_target_Nm - x[brake_torque];
  if (std::abs(distance_Nm) * held.brake_rate_per_s > held.brake_limit_Nm_s) {
    const double free_Nm = held.brake_limit_Nm_s / held.brake_rate_per_s;
    const double ramp_s = std::min(duration_s, (std::abs(distance_Nm) - free_Nm) / held.brake_limit_Nm_s);
    x[brake_torque] += std::copysign(held.brake_limit_Nm_s * ramp_s, distance_Nm);
    lag_s -= ramp_s;
  }
  const double remainder = std::exp(-held.brake_rate_per_s * lag_s);
  x[brake_torque] = held.brake_target_Nm + remainder * (x[brake_torque] - held.brake_target_Nm);
}

/// Integrates `x` to the event within `step_s`. Returns the integrated time.
double step_to_event(TorqueBalance& balance, double step_s, StateVector& x) noexcept {
  double taken_s = event_step_s(balance, x, step_s);
  StateVector end = runge_kutta_step(balance, x, taken_s);
  const bool upper_stops = balance.sliding.upper * end[omega1] < 0.0;
  const bool lower_stops = balance.sliding.lower * end[omega2] < 0.0;
  if (taken_s < least_slide_s && ((upper_stops && x[omega1] == 0.0) || (lower_stops && x[omega2] == 0.0))) {
    // Hold the wheel: rounding could otherwise make it break away and stop again endlessly without progress in time.
    if (upper_stops) balance.sliding.upper = 0.0;
    if (lower_stops) balance.sliding.lower = 0.0;
    taken_s = std::min(least_slide_s, step_s);
    end = runge_kutta_step(balance, x, taken_s);
  }
  if (upper_stops) end[omega1] = 0.0;
  if (lower_stops) end[omega2] = 0.0;
  x = end;
  return taken_s;
}

/// A step with which a turning wheel comes to stand.
bool halts(const StateVector& before, const StateVector& end) noexcept {
  return before[omega1] != 0.0 && before[omega2] != 0.0 && (end[omega1] == 0.0 || end[omega2] == 0.0);
}

/// What `roll` needs besides the models.
struct Rolling {
  BasicWheels<double> wheels;
  const HeldTorques& held;
  double max_step_s;
  double duration_s;
  double friction;
  double end_angle2_rad;  ///< where this friction ends
};

template <class Tyre, class Load>
[[gnu::always_inline]] inline double roll_on(const Tyre& tyre, const Load& load, const Rolling& r,
                                             StateVector& x) noexcept {
  const RollingBalance<double, Tyre, Load, HeldTorques> balance{tyre, load, r.wheels, r.held, r.friction};
  const double steps = steps_for(r.duration_s, r.max_step_s, balance.fastest_rate_per_s(x));
  const double step_s = r.duration_s / steps;
  const auto rolls = [&r](const StateVector& end) {
    return end[omega1] >= 0.0 && end[omega2] >= 0.0 && end[angle2] <= r.end_angle2_rad;
  };
  const double made = steps_made(balance, steps, step_s, true, x, rolls, halts);
  return made == steps ? r.duration_s : made * step_s;
}

// Not on Windows, whose stack GCC does not align for such functions.
#if defined(__x86_64__) && !defined(_WIN32)
#define ABS_HIL_ROLL_BY_AVX
/// The same instructions in AVX's encoding, which needs fewer moves between registers. Nothing is contracted, so the
/// bits are the same.
template <class Tyre, class Load>
[[gnu::target("avx2"), gnu::flatten]] double roll_by_avx(const Tyre& tyre, const Load& load, const Rolling& r,
                                                         StateVector& x) noexcept {
  return roll_on(tyre, load, r, x);
}
const bool has_avx = __builtin_cpu_supports("avx2") != 0;
#endif

/// Integrates `x` while both wheels turn forwards on a road that does not change. Returns the integrated time:
/// `duration_s`, unless a wheel would stop before or this friction ends.
double roll(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s,
            const PresentFactor& friction, StateVector& x) noexcept {
  const Rolling rolling{
      BasicWheels<double>(model.wheels()), held, max_step_s, duration_s, friction.value, friction.end_angle2_rad};
  return model.visit([&](const auto& tyre, const auto& load) {
#ifdef ABS_HIL_ROLL_BY_AVX
    if (has_avx) return roll_by_avx(tyre, load, rolling, x);
#endif
    return roll_on(tyre, load, rolling, x);
  });
}

/// Integrates `x` in equal steps to the next event within `duration_s`, or over all of it. Returns the integrated time.
/// @param several  false: makes one step only, because the road changes
double slide(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s, bool several,
             const PresentFactor& friction, StateVector& x) noexcept {
  TorqueBalance balance{model, held, friction, {}};
  balance.sliding = sliding_from(balance, x);
  const double steps = steps_for(duration_s, max_step_s, fastest_rate_per_s(balance, x));
  const double step_s = duration_s / steps;
  const auto goes_on = [&](const StateVector& end) { return !(margin(balance, end, step_s) < 0.0); };
  const double made = steps_made(balance, several ? steps : 1.0, step_s, true, x, goes_on, halts);
  if (made == steps) return duration_s;
  return made > 0.0 ? made * step_s : step_to_event(balance, step_s, x);
}

}  // namespace

Sliding sliding_from(TorqueBalance balance, const StateVector& x) noexcept {
  // Assume first that a standing upper wheel is held. If its friction cannot hold it then, it cannot hold it with the
  // force of the sliding wheel either, which differs for a load that depends on the brake.
  balance.sliding = {sign_of(x[omega1]), sign_of(x[omega2])};
  if (x[omega1] != 0.0 && x[omega2] != 0.0) return balance.sliding;
  const WheelModel& model = balance.model;
  const double force_N = balance.tyre_force_N(x, 0.0);
  return {direction(x[omega1], pull_on_upper_Nm(model, force_N), hold_of_upper_Nm(balance, x)),
          direction(x[omega2], pull_on_lower_Nm(model, balance.held, force_N), model.wheels().M20_Nm)};
}

double margin(const TorqueBalance& balance, const StateVector& x, double time_s) noexcept {
  const WheelModel& model = balance.model;
  const Sliding& sliding = balance.sliding;
  const double to_roll_rad = balance.friction.end_angle2_rad - x[angle2];
  if (sliding.upper != 0.0 && sliding.lower != 0.0) {
    return std::min({sliding.upper * x[omega1], sliding.lower * x[omega2], to_roll_rad});
  }
  const double force_N = balance.tyre_force_N(x, time_s);
  const double upper = sliding.upper != 0.0 ? sliding.upper * x[omega1]
                                            : hold_of_upper_Nm(balance, x) - std::abs(pull_on_upper_Nm(model, force_N));
  const double lower = sliding.lower != 0.0
                           ? sliding.lower * x[omega2]
                           : model.wheels().M20_Nm - std::abs(pull_on_lower_Nm(model, balance.held, force_N));
  return std::min({upper, lower, to_roll_rad});
}

bool stands_for_good(const WheelModel& model, const HeldTorques& held, const StateVector& x) noexcept {
  return x[omega1] == 0.0 && x[omega2] == 0.0 && std::abs(pull_on_lower_Nm(model, held, 0.0)) <= model.wheels().M20_Nm;
}

void integrate(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s,
               FactorProgress& profile, StateVector& x) noexcept {
  double left_s = duration_s;
  while (left_s > 0.0) {
    if (stands_for_good(model, held, x)) {
      stand(held, left_s, x);
      profile.pass(left_s);
      break;
    }
    const PresentFactor friction = profile.present(x[angle2]);
    const double interval_s = std::min(left_s, profile.time_left_s());
    const bool rolls = x[omega1] > 0.0 && x[omega2] > 0.0 && friction.holds() && !model.apart();
    double taken_s = rolls ? roll(model, max_step_s, held, interval_s, friction, x) : 0.0;
    if (taken_s == 0.0) taken_s = slide(model, max_step_s, held, interval_s, friction.holds(), friction, x);
    left_s -= taken_s;
    profile.pass(taken_s);
    profile.settle(x[angle2]);
  }
  profile.settle(x[angle2]);
}

}  // namespace abs_hil::plant_sim
