#include "plant_sim/stepping.hpp"

#include <algorithm>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <cmath>

#include "plant_sim/dry_friction.hpp"

namespace abs_hil::plant_sim {
namespace {

/// Ratio of step and time constant of the slip dynamics. RK4 is stable up to 2.78; tests/plant_sim/accuracy_test.cpp
/// shows the error at this value.
constexpr double slip_time_constant_fraction = 0.3;
/// If a wheel breaks away and is held again within this time, the torque on it equalled its friction within rounding.
constexpr double least_slide_s = 1e-6;
/// Bisections of the interval that contains a stop or break-away: down to 10^-12 of the substep.
constexpr int event_bisections = 40;

/// One Runge-Kutta step of `step_s` from `x` with a fixed direction of sliding.
StateVector stepped(const TorqueBalance& balance, const StateVector& x, double step_s) noexcept {
  boost::numeric::odeint::runge_kutta4<StateVector> stepper;
  StateVector end{};
  stepper.do_step(balance, x, 0.0, end, step_s);
  return end;
}

/// Step limit from `max_step_s` and the slip dynamics. Their time constant decreases with the car speed; for the magic
/// formula it is v_x / (theta B C (r1^2/J1 + r2^2/J2)). A held wheel has no slip dynamics.
double step_limit_s(const TorqueBalance& balance, const StateVector& x, double max_step_s) noexcept {
  const rig::WheelParameters& w = balance.model.wheels();
  const Sliding& sliding = balance.sliding;
  const double mobility_per_kg = (sliding.upper != 0.0 ? w.r1_m * w.r1_m / w.J1_kg_m2 : 0.0) +
                                 (sliding.lower != 0.0 ? w.r2_m * w.r2_m / w.J2_kg_m2 : 0.0);
  const ContactState steepest{x[omega1], x[omega2], x[brake_torque], sliding.upper, balance.friction.highest};
  const double rate_per_s = balance.model.damping_bound_Ns_m(steepest) * mobility_per_kg;
  return std::min(max_step_s, slip_time_constant_fraction / rate_per_s);
}

/// Shortest step, within 10^-12 of `step_s`, after which `margin` is negative. It must be negative after `step_s`.
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

/// Integrates `x` to the first event before `step_s`, or over all of it. Returns the integrated time.
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
    // Hold the wheel: rounding could otherwise make it break away and stop again endlessly without progress in time.
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

/// Both wheels stand: only the brake's lag (6) continues, in closed form.
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
    // Equal parts of the remaining time; the last part is exactly the rest, so the interval ends exactly.
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
