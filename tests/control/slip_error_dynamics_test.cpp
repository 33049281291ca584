// The sampled-data form of (16) against the printed one.
#include "abs_hil/control/slip_error_dynamics.hpp"

#include <cmath>
#include <random>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// (16) as printed, in continuous time.
double printed_law_Nm(const rig::RigParameters& rig, double ks0, double ks1, double integral, double error,
                      double theta, const control::SlipInput& in) {
  const auto& w = rig.wheels;
  const double k = w.r1_m * w.r1_m / w.J1_kg_m2 + (1 - in.slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
  const double phi = std::sin(rig.tyre.C * std::atan(rig.tyre.B * in.slip));
  return w.J1_kg_m2 / w.r1_m *
         (-ks0 * integral - ks1 * error + k * theta * phi -
          w.r1_m / w.J1_kg_m2 * (w.d1_Nms_rad * in.speeds.omega1_rad_s + w.M10_Nm) +
          (1 - in.slip_ref) * w.r2_m / w.J2_kg_m2 * (w.d2_Nms_rad * in.speeds.omega2_rad_s + w.M20_Nm));
}

}  // namespace

TEST_CASE("The sampled-data law tends to the printed one as the period goes to 0") {
  std::mt19937 random{11};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  for (int i = 0; i < 50; ++i) {
    rig::RigParameters rig;
    control::ControlOptions options;
    options.adaptive.ks0 = 5 + 40 * unit(random);
    options.adaptive.ks1 = 5 + 60 * unit(random);
    const double integral = 0.2 * unit(random) - 0.1, error = 4 * unit(random) - 3, theta = 60 * unit(random);
    control::SlipInput in{.slip_ref = 0.05 + 0.25 * unit(random)};
    in.speeds.omega2_rad_s = 20 + 150 * unit(random);
    in.speeds.omega1_rad_s = ((1 - in.slip_ref) * 0.0990 * in.speeds.omega2_rad_s - error) / 0.0995;
    in.slip = 1.2 * unit(random) - 0.2;
    const double printed = printed_law_Nm(rig, options.adaptive.ks0, options.adaptive.ks1, integral, error, theta, in);
    double last_gap = 0.0;
    for (const double rate_Hz : {1e4, 1e5, 1e6}) {
      options.rate_Hz = rate_Hz;
      const control::SlipErrorDynamics dynamics{{options, rig}};
      last_gap = std::abs(dynamics.feedback_linearising_torque_Nm(
                              in, integral, error, theta, std::sin(rig.tyre.C * std::atan(rig.tyre.B * in.slip))) -
                          printed);
      CHECK(last_gap < 2000.0 / rate_Hz);
    }
    CHECK(last_gap < 2e-3);
  }
}

TEST_CASE("At 100 Hz the wanted rate is the mean over the period, for real and for complex poles") {
  for (const double ks1 : {32.0, 4.0}) {
    rig::RigParameters rig;
    rig.wheels.d1_Nms_rad = rig.wheels.d2_Nms_rad = rig.wheels.M10_Nm = rig.wheels.M20_Nm = 0.0;
    control::ControlOptions options;
    options.rate_Hz = 100.0;
    options.adaptive.ks1 = ks1;
    const control::SlipErrorDynamics dynamics{{options, rig}};
    const double integral = 0.03, error = -0.8;
    // theta = 0 and no friction leave the wanted rate alone: J1/r1 (e_v(h) - e_v(0))/h, by fine RK4 of A.
    double I = integral, e = error;
    const int n = 1000;
    const double h = 0.01 / n;
    for (int j = 0; j < n; ++j) {
      const auto rate = [&](double x, double y) { return -19.0 * x - ks1 * y; };
      const double a1 = e, b1 = rate(I, e);
      const double a2 = e + h / 2 * b1, b2 = rate(I + h / 2 * a1, e + h / 2 * b1);
      const double a3 = e + h / 2 * b2, b3 = rate(I + h / 2 * a2, e + h / 2 * b2);
      const double a4 = e + h * b3, b4 = rate(I + h * a3, e + h * b3);
      I += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
      e += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4);
    }
    const control::SlipInput in{.speeds = {140.0, 170.0}, .slip = 0.1, .slip_ref = 0.15};
    const double torque = dynamics.feedback_linearising_torque_Nm(in, integral, error, 0.0, 0.5);
    CHECK_THAT(torque, WithinRel(rig.wheels.J1_kg_m2 / rig.wheels.r1_m * (e - error) / 0.01, 1e-9));
  }
}
