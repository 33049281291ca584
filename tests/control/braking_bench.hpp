#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/registry.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/brake_actuator.hpp"
#include "control/tracking_observer.hpp"

/// A plant and a control loop for the tests: plain RK4 of (11), independent of plant_sim.
namespace bench {

using namespace abs_hil;

/// State of (11) with the brake's lag (6), the wheels' angles and the distance.
struct PlantState {
  double omega1{170.0}, omega2{170.0}, torque{0.0}, angle1{0.0}, angle2{0.0}, way{0.0};
};

struct Setup {
  rig::RigParameters rig{};
  std::optional<rig::RigParameters> plant{};  ///< the plant's own parameters; empty: those of `rig`, as believed
  control::ControlOptions options{};
  bool ideal_actuator{true};
  bool encoders{false};
  double omega1_start{170.0}, omega2_start{170.0};
  double max_time_s{10.0};
  double plant_step_s{20e-6};
  std::function<double(double)> theta_at{};  ///< theta(t), instead of tyre.theta_N
  double angle1_start{0.3e-3}, angle2_start{1.1e-3};

  [[nodiscard]] const rig::RigParameters& true_rig() const { return plant ? *plant : rig; }
};

struct Tick {
  double t{}, omega1{}, omega2{}, slip{}, torque{}, way{};
  control::SlipInput input{};
  control::SlipOutput output{};
  double applied_Nm{};
};

struct Result {
  std::vector<Tick> ticks;
  double stop_time_s{std::numeric_limits<double>::quiet_NaN()};
  double stop_distance_m{0.0};
  double slip_rms{0.0};  ///< t > 0.3 s and v_x > 3 m/s
};

inline double e_v(const rig::WheelParameters& w, double omega1, double omega2, double slip_ref) {
  return (1 - slip_ref) * w.r2_m * omega2 - w.r1_m * omega1;
}

/// [I; e_v] after t on e_v'' + ks1 e_v' + ks0 e_v = 0 with real poles, as a sum of two exponentials.
inline std::array<double, 2> closed_form(double integral0, double error0, double ks0, double ks1, double t) {
  const double root = std::sqrt(ks1 * ks1 - 4 * ks0);
  const double s1 = (-ks1 + root) / 2, s2 = (-ks1 - root) / 2;
  // I = c1 exp(s1 t) + c2 exp(s2 t), e_v = I'
  const double c2 = (error0 - s1 * integral0) / (s2 - s1), c1 = integral0 - c2;
  const double x1 = c1 * std::exp(s1 * t), x2 = c2 * std::exp(s2 * t);
  return {x1 + x2, s1 * x1 + s2 * x2};
}

/// RK4 of (11) over `dt`, with the torque of an ideal actuator held, or b(u) held behind the lag (6).
inline void integrate(PlantState& x, const Setup& s, double theta, double target_Nm, double dt) {
  const auto& truth = s.true_rig();
  const auto& w = truth.wheels;
  using Vector = std::array<double, 6>;
  const auto rate = [&](const Vector& y) -> Vector {
    const double v_x = w.r2_m * y[1];
    const double slip = (v_x - w.r1_m * y[0]) / v_x;
    const double force = theta * std::sin(truth.tyre.C * std::atan(truth.tyre.B * slip));
    double rate1 = (w.r1_m * force - (w.d1_Nms_rad * y[0] + w.M10_Nm + y[2])) / w.J1_kg_m2;
    if (y[0] <= 0.0 && rate1 < 0.0) rate1 = 0.0;  // held by the brake
    const double rate2 = (-w.r2_m * force - (w.d2_Nms_rad * y[1] + w.M20_Nm)) / w.J2_kg_m2;
    return {rate1, rate2, s.ideal_actuator ? 0.0 : truth.brake.c31_per_s * (target_Nm - y[2]), y[0], y[1], v_x};
  };
  if (s.ideal_actuator) x.torque = target_Nm;
  const auto plus = [](const Vector& a, const Vector& b, double f) {
    Vector c{};
    for (std::size_t i = 0; i < c.size(); ++i) c[i] = a[i] + f * b[i];
    return c;
  };
  Vector y{x.omega1, x.omega2, x.torque, x.angle1, x.angle2, x.way};
  const int steps = std::max(1, static_cast<int>(std::lround(dt / s.plant_step_s)));
  const double h = dt / steps;
  for (int i = 0; i < steps; ++i) {
    const Vector k1 = rate(y), k2 = rate(plus(y, k1, h / 2)), k3 = rate(plus(y, k2, h / 2)), k4 = rate(plus(y, k3, h));
    for (std::size_t j = 0; j < y.size(); ++j) y[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    y[0] = std::max(y[0], 0.0);
  }
  x = {y[0], y[1], y[2], y[3], y[4], y[5]};
}

inline std::int32_t counts_at(double angle, std::int32_t per_rev) {
  return static_cast<std::int32_t>(std::floor(angle / (2 * std::numbers::pi) * per_rev));
}

/// Tells the controller's next step what was sent of `torque_Nm`: that within [0, max_brake_torque_Nm].
inline void note_sent(control::SlipInput& next, double torque_Nm) {
  next.sent_brake_torque_Nm = std::clamp(torque_Nm, 0.0, next.max_brake_torque_Nm);
  next.unsent_torque_Nm = torque_Nm - next.sent_brake_torque_Nm;
}

/// The same rig with all forces times `factor`.
inline void scale_forces(rig::RigParameters& rig, double factor) {
  auto& w = rig.wheels;
  for (double* force : {&w.J1_kg_m2, &w.J2_kg_m2, &w.d1_Nms_rad, &w.d2_Nms_rad, &w.M10_Nm, &w.M20_Nm, &rig.brake.b1_Nm,
                        &rig.brake.b2_Nm, &rig.tyre.theta_N})
    *force *= factor;
}

/// Brakes with `controller` from the start speeds until v_x < v_min, as the runtime does cycle by cycle.
inline Result brake(const Setup& s, control::SlipController& controller) {
  const double h = 1.0 / s.options.rate_Hz;
  const auto& w = s.true_rig().wheels;
  const auto& believed = s.rig.wheels;
  PlantState x{.omega1 = s.omega1_start, .omega2 = s.omega2_start, .angle1 = s.angle1_start, .angle2 = s.angle2_start};
  control::BrakeActuator actuator{s.rig.brake, s.ideal_actuator, 1.0};
  control::TrackingObserver upper{s.options.observer, s.rig.encoder_counts_per_rev};
  control::TrackingObserver lower{s.options.observer, s.rig.encoder_counts_per_rev};
  const std::int32_t per_rev = s.rig.encoder_counts_per_rev;
  if (s.encoders) {
    // The observers have settled in the previous phase.
    const int warm_up = static_cast<int>(0.5 / h);
    const double angle1 = x.angle1 - warm_up * h * x.omega1;
    const double angle2 = x.angle2 - warm_up * h * x.omega2;
    upper.reset(counts_at(angle1, per_rev), x.omega1);
    lower.reset(counts_at(angle2, per_rev), x.omega2);
    for (int i = 1; i <= warm_up; ++i) {
      upper.update(counts_at(angle1 + i * h * x.omega1, per_rev), h);
      lower.update(counts_at(angle2 + i * h * x.omega2, per_rev), h);
    }
  }
  Result result;
  double square_sum = 0.0;
  int square_count = 0;
  double v_before = 0.0;
  rig::WheelSpeeds speeds_before{s.omega1_start, s.omega2_start};
  double angle1_before = x.angle1, angle2_before = x.angle2;
  double sent_Nm = 0.0, unsent_Nm = 0.0;
  // Torques that do not act yet: the true rig's dead time, in whole cycles.
  std::deque<double> ahead_Nm(static_cast<std::size_t>(std::lround(s.true_rig().brake.brake_dead_time_s / h)), 0.0);
  const auto travel = [&](double now, double before) {
    if (!s.encoders) return now - before;
    return (counts_at(now, per_rev) - counts_at(before, per_rev)) * 2 * std::numbers::pi / per_rev;
  };
  for (int n = 0;; ++n) {
    const double t = n * h;
    if (n > 0 && s.encoders) {
      upper.update(counts_at(x.angle1, per_rev), h);
      lower.update(counts_at(x.angle2, per_rev), h);
    }
    if (n > 0) actuator.advance(h);
    const double v_x = w.r2_m * x.omega2;
    const double slip = (v_x - w.r1_m * x.omega1) / v_x;
    if (n > 0) result.stop_distance_m += 0.5 * h * (v_before + v_x);
    v_before = v_x;
    const rig::WheelSpeeds speeds =
        s.encoders ? rig::WheelSpeeds{upper.omega_rad_s(), lower.omega_rad_s()} : rig::WheelSpeeds{x.omega1, x.omega2};
    control::SlipInput input{
        .dt_s = n > 0 ? h : 0.0,
        .speeds = speeds,
        .slip = rig::wheel_slip(believed.r1_m * speeds.omega1_rad_s, believed.r2_m * speeds.omega2_rad_s,
                                s.options.v_min_m_s),
        .slip_ref = s.options.slip_ref,
        .mean_brake_torque_Nm = actuator.mean_torque_Nm(),
        .brake_torque_Nm = actuator.torque_Nm(),
        .max_brake_torque_Nm = actuator.max_torque_Nm(),
        .alpha1_rad_s2 = s.encoders ? upper.alpha_rad_s2() : (speeds.omega1_rad_s - speeds_before.omega1_rad_s) / h,
        .alpha2_rad_s2 = s.encoders ? lower.alpha_rad_s2() : (speeds.omega2_rad_s - speeds_before.omega2_rad_s) / h,
        .upper_travel_rad = travel(x.angle1, angle1_before),
        .lower_travel_rad = travel(x.angle2, angle2_before),
        .sent_brake_torque_Nm = sent_Nm,
        .unsent_torque_Nm = unsent_Nm,
        .ahead = actuator.ahead()};
    angle1_before = x.angle1;
    angle2_before = x.angle2;
    speeds_before = speeds;
    if (n == 0) controller.reset(input);
    const control::SlipOutput output = controller.step(input);
    const double wanted = actuator.limited(output.brake_torque_Nm);
    const double duty = actuator.duty_for(wanted);
    actuator.command(duty, wanted);
    sent_Nm = actuator.static_torque_Nm(duty, wanted);
    unsent_Nm = actuator.unsent_Nm(output.brake_torque_Nm, wanted, sent_Nm);
    result.ticks.push_back({t, x.omega1, x.omega2, slip, x.torque, x.way, input, output, wanted});
    if (t > 0.3 && v_x > 3.0) {
      square_sum += std::pow(slip - s.options.slip_ref, 2);
      ++square_count;
    }
    if (v_x < s.options.v_min_m_s) {
      result.stop_time_s = t;
      break;
    }
    if (t > s.max_time_s) break;
    const double theta = s.theta_at ? s.theta_at(t + h / 2) : s.true_rig().tyre.theta_N;
    const auto& b = s.true_rig().brake;
    const double map_Nm = duty >= b.u0 ? b.b1_Nm * duty + b.b2_Nm : 0.0;  // (7)
    ahead_Nm.push_back(s.ideal_actuator ? wanted : map_Nm);
    integrate(x, s, theta, ahead_Nm.front(), h);
    ahead_Nm.pop_front();
  }
  if (square_count > 0) result.slip_rms = std::sqrt(square_sum / square_count);
  return result;
}

inline Result brake(const Setup& s, std::string_view name) {
  const auto controller = control::make_controller(name, {s.options, s.rig});
  return brake(s, *controller);
}

}  // namespace bench
