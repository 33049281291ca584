#include "plant_sim/stepping.hpp"

#include <algorithm>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <cmath>

#include "plant_sim/dry_friction.hpp"

namespace abs_hil::plant_sim {
namespace {

/// Step over time constant of the slip dynamics. RK4 is stable up to 2.78; tests/plant_sim/accuracy_test.cpp shows what
/// error this value leaves.
constexpr double slip_time_constant_fraction = 0.3;
/// A wheel that breaks away and is held again within this time was pulled no harder than its friction, but for
/// rounding.
constexpr double least_slide_s = 1e-6;
/// Halvings of the bracket of a stop or break-away: to a 10^-12th of the substep.
constexpr int event_bisections = 40;

/// One Runge-Kutta step of `step_s` from `x`, with the way of sliding held.
StateVector stepped(const TorqueBalance& balance, const StateVector& x, double step_s) noexcept {
  boost::numeric::odeint::runge_kutta4<StateVector> stepper;
  StateVector end{};
  stepper.do_step(balance, x, 0.0, end, step_s);
  return end;
}

/// The step that `max_step_s` and the slip dynamics allow. Their time constant, which for the magic formula is
/// v_x / (theta B C (r1^2/J1 + r2^2/J2)), falls with the car speed; a held wheel has no part in them.
double step_limit_s(const TorqueBalance& balance, const StateVector& x, double max_step_s) noexcept {
  const rig::WheelParameters& w = balance.model.wheels();
  const Sliding& sliding = balance.sliding;
  const double mobility_per_kg = (sliding.upper != 0.0 ? w.r1_m * w.r1_m / w.J1_kg_m2 : 0.0) +
                                 (sliding.lower != 0.0 ? w.r2_m * w.r2_m / w.J2_kg_m2 : 0.0);
  const ContactState steepest{x[omega1], x[omega2], x[brake_torque], sliding.upper, balance.friction.highest};
  const double rate_per_s = balance.model.damping_bound_Ns_m(steepest) * mobility_per_kg;
  return std::min(max_step_s, slip_time_constant_fraction / rate_per_s);
}

/// The shortest step, within 10^-12 of `step_s`, after which `margin` is negative; it is so after `step_s`.
double event_step_s(const TorqueBalance& balance, const StateVector& x, double step_s) noexcept {
  double before_s = 0.0;
  double after_s = step_s;
  for (int i = 0; i < event_bisections; ++i) {
    const double middle_s = 0.5 * (before_s + after_s);
    const StateVector middle = stepped(balance, x, middle_s);
    (margin(balance, middle, middle_s) < 0.0 ? after_s : before_s) = middle_s;
  }
  return after_s;
}

/// Goes on from `x` to the first event before `step_s`, or for all of it. Returns the time passed.
double substep(TorqueBalance& balance, double step_s, StateVector& x) noexcept {
  const StateVector whole = stepped(balance, x, step_s);
  if (!(margin(balance, whole, step_s) < 0.0)) {
    x = whole;
    return step_s;
  }
  double taken_s = event_step_s(balance, x, step_s);
  StateVector end = stepped(balance, x, taken_s);
  const bool upper_stops = balance.sliding.upper * end[omega1] < 0.0;
  const bool lower_stops = balance.sliding.lower * end[omega2] < 0.0;
  if (taken_s < least_slide_s && ((upper_stops && x[omega1] == 0.0) || (lower_stops && x[omega2] == 0.0))) {
    // Hold it, or rounding could make it break away and stop for ever without time passing.
    if (upper_stops) balance.sliding.upper = 0.0;
    if (lower_stops) balance.sliding.lower = 0.0;
    taken_s = std::min(least_slide_s, step_s);
    end = stepped(balance, x, taken_s);
  }
  if (upper_stops) end[omega1] = 0.0;
  if (lower_stops) end[omega2] = 0.0;
  x = end;
  return taken_s;
}

/// Nothing turns: only the brake's lag (6) goes on, by its closed form.
void stand(const HeldTorques& held, double duration_s, StateVector& x) noexcept {
  const double remainder = std::exp(-held.brake_rate_per_s * duration_s);
  x[brake_torque] = held.brake_target_Nm + remainder * (x[brake_torque] - held.brake_target_Nm);
}

}  // namespace

void integrate(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s,
               FactorProgress& profile, StateVector& x) noexcept {
  double left_s = duration_s;
  while (left_s > 0.0) {
    if (stands_for_good(model, held, x)) {
      stand(held, left_s, x);
      profile.pass(left_s);
      break;
    }
    TorqueBalance balance{model, held, profile.present(x[angle2]), {}};
    balance.sliding = sliding_from(balance, x);
    // Equal parts of what is left; the last part is what is left, so the interval ends exactly.
    const double interval_s = std::min(left_s, profile.time_left_s());
    const double parts = std::ceil(interval_s / step_limit_s(balance, x, max_step_s));
    const double taken_s = substep(balance, parts > 1.0 ? interval_s / parts : interval_s, x);
    left_s -= taken_s;
    profile.pass(taken_s);
    profile.settle(x[angle2]);
  }
  profile.settle(x[angle2]);
}

}  // namespace abs_hil::plant_sim
