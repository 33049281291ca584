// The observer of speeds and tyre force: its errors and delay beside the paper's controller.
#include "control/wheel_force_observer.hpp"

#include <cmath>
#include <stdexcept>

#include "catch.hpp"
#include "control/braking_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

struct Errors {
  double omega1_rms{0.0}, tracking_omega1_rms{0.0}, force_rms_N{0.0}, last_brake_error_Nm{0.0};
};

double force_of(const bench::Setup& s, const bench::Tick& tick) {
  const double theta_N = s.theta_at ? s.theta_at(tick.t) : s.true_rig().tyre.theta_N;
  return theta_N * std::sin(s.true_rig().tyre.C * std::atan(s.true_rig().tyre.B * tick.slip));
}

/// The observer beside the paper's controller, on the real rig.
Errors beside(const bench::Setup& s) {
  control::WheelForceObserver observer{control::ForceObserverOptions<>{}, s.rig, s.options.rate_Hz};
  Errors errors;
  int count = 0;
  for (const auto& tick : bench::brake(s, "adaptive").ticks) {
    if (tick.t == 0.0) observer.reset(tick.input.speeds);
    observer.update(tick.input);
    if (tick.t < 0.1 || s.rig.wheels.r2_m * tick.omega2 < 3.0) continue;
    errors.omega1_rms += std::pow(observer.speeds().omega1_rad_s - tick.omega1, 2);
    errors.tracking_omega1_rms += std::pow(tick.input.speeds.omega1_rad_s - tick.omega1, 2);
    errors.force_rms_N += std::pow(observer.force_N() - force_of(s, tick), 2);
    errors.last_brake_error_Nm = observer.brake_error_Nm();
    ++count;
  }
  for (double* sum : {&errors.omega1_rms, &errors.tracking_omega1_rms, &errors.force_rms_N}) {
    *sum = std::sqrt(*sum / count);
  }
  return errors;
}

bench::Setup real_rig() {
  bench::Setup s;
  s.ideal_actuator = false;
  s.encoders = true;
  s.plant_step_s = 1e-4;
  return s;
}

}  // namespace

TEST_CASE("Speed and tyre force from counts and the brake's model, better than speeds without a model") {
  auto s = real_rig();
  s.theta_at = [](double t) { return t < 0.8 || t >= 1.2 ? 23.0 : 12.0; };
  const Errors errors = beside(s);
  CHECK(errors.omega1_rms < 0.1);
  CHECK(errors.omega1_rms < 0.5 * errors.tracking_omega1_rms);
  CHECK(errors.force_rms_N < 1.5);  // mostly the lag at the two jumps by 11 N
}

TEST_CASE("A brake stronger than the model says shows as its error, and hardly in the force") {
  auto s = real_rig();
  s.plant = s.rig;
  s.plant->brake.b1_Nm *= 1.1;
  const Errors errors = beside(s);
  // 0.1 b1 u, at u = (T + 6.21) / 16.8 for the 2.6 N m or so that hold slip 0.15.
  CHECK_THAT(errors.last_brake_error_Nm, WithinAbs(0.1 * 15.24 * (2.6 + 6.21) / 16.8, 0.1));
  CHECK(errors.force_rms_N < 1.0);
}

TEST_CASE("The force follows a ramp with the delay that the observer states") {
  control::WheelForceObserver observer{control::ForceObserverOptions<>{}, rig::RigParameters{}, 1000.0};
  const rig::WheelParameters w;
  double omega1 = 150.0, omega2 = 160.0;
  observer.reset({omega1, omega2});
  constexpr double slope_N_s = 40.0;
  double lag_s = 0.0;
  for (int n = 1; n <= 400; ++n) {
    const double force_N = slope_N_s * n * 1e-3;
    const double alpha1 = (w.r1_m * (force_N - slope_N_s * 0.5e-3) - w.d1_Nms_rad * omega1 - w.M10_Nm) / w.J1_kg_m2;
    const double alpha2 = (-w.r2_m * (force_N - slope_N_s * 0.5e-3) - w.d2_Nms_rad * omega2 - w.M20_Nm) / w.J2_kg_m2;
    observer.update({.dt_s = 1e-3,
                     .upper_travel_rad = (omega1 + 0.5e-3 * alpha1) * 1e-3,
                     .lower_travel_rad = (omega2 + 0.5e-3 * alpha2) * 1e-3});
    omega1 += 1e-3 * alpha1;
    omega2 += 1e-3 * alpha2;
    lag_s = (force_N - observer.force_N()) / slope_N_s;
  }
  CHECK_THAT(lag_s, WithinAbs(observer.force_delay_s(), 1e-3));
  CHECK(observer.force_delay_s() > 0.002);
  CHECK(observer.force_delay_s() < 0.02);
}

TEST_CASE("Intensities and rates that make no sense are refused") {
  const rig::RigParameters rig;
  CHECK_THROWS_AS((control::WheelForceObserver{{.force_rate_N2_s = 0.0}, rig, 1000.0}), std::invalid_argument);
  CHECK_THROWS_AS((control::WheelForceObserver{{.brake_rate_Nm2_s = -1.0}, rig, 1000.0}), std::invalid_argument);
  CHECK_THROWS_AS((control::WheelForceObserver{{}, rig, 0.0}), std::invalid_argument);
}
