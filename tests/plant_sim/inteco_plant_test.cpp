// The maker's model against the equations of its manual.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "brake_profiles.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double r1 = 0.0995, r2 = 0.0990, J1 = 7.53e-3, J2 = 25.60e-3;
constexpr double d1 = 118.74e-6, d2 = 214.68e-6, M10 = 0.0032, M20 = 0.0925;
constexpr double tick_s = 1e-3;

/// Braking at a constant slip, from the manual's equations alone. With r1 w1 = (1 - slip) r2 w2 the upper wheel's
/// torque balance gives the brake torque, and the lever gives a force that is linear in w2: w2' = -(a + b w2).
struct ConstantSlip {
  double k, mu_arm, slip;

  explicit ConstantSlip(double s) : k((1.0 - s) * r2 / r1), slip(s) {
    const double power = std::pow(s, 2.09945271667129);
    const double mu = 0.40662691102315 * power / (0.00025724985785 + power) + 0.03508217905067 * s * s * s +
                      2.9375e-10 * s * s - 0.04240011450454 * s;
    const double phi = 65.61 * std::acos(-1.0) / 180.0;
    mu_arm = 0.370 * (std::sin(phi) - mu * std::cos(phi)) / mu;
  }
  double force_N(double w2) const { return (19.62 + J1 * k / J2 * (d2 * w2 + M20)) / (mu_arm - r1 - J1 * k * r2 / J2); }
  double w2_rate(double w2) const { return -(r2 * force_N(w2) + d2 * w2 + M20) / J2; }
  double brake_torque_Nm(double w2) const { return r1 * force_N(w2) - d1 * k * w2 - M10 - J1 * k * w2_rate(w2); }
  double b_per_s() const { return (w2_rate(0.0) - w2_rate(100.0)) / 100.0; }
  double time_s(double from_w2, double to_w2) const { return std::log(w2_rate(from_w2) / w2_rate(to_w2)) / b_per_s(); }
  double way_m(double from_w2, double to_w2) const {
    return r2 * ((from_w2 - to_w2) + w2_rate(0.0) * time_s(from_w2, to_w2)) / b_per_s();
  }
};

struct Stop {
  double time_s, way_m, slip_error;
};

/// Brakes the plant from 170 rad/s to `end_w2` at a constant slip: with the torque above and a feedback that only
/// removes the error of a constant torque within a tick.
Stop stop_at(double slip, double end_w2) {
  PlantOptions options = inteco_manual();
  options.ideal_actuator = true;
  const ConstantSlip exact(slip);
  Plant plant(options);
  plant.reset({.omega1_rad_s = exact.k * 170.0, .omega2_rad_s = 170.0});
  Stop stop{};
  double before_w2 = 170.0;
  double before_rad = 0.0;
  for (int tick = 0; tick < 3000; ++tick) {
    const double w2 = plant.state().omega2_rad_s;
    if (w2 < end_w2) {
      const double share = (before_w2 - end_w2) / (before_w2 - w2);
      stop.time_s = tick_s * (tick - 1 + share);
      stop.way_m = r2 * (before_rad + share * (plant.state().angle2_rad - before_rad));
      return stop;
    }
    if (r2 * w2 > 1.0) stop.slip_error = std::max(stop.slip_error, std::abs(plant.slip() - slip));
    before_w2 = w2;
    before_rad = plant.state().angle2_rad;
    const double feedback_Nm = 100.0 * J1 * (plant.state().omega1_rad_s - exact.k * w2);
    const double locked_Nm = slip == 1.0 ? 9.0 : 0.0;
    plant.advance(tick_s, {.brake_torque_Nm = std::max(0.0, exact.brake_torque_Nm(w2) + feedback_Nm + locked_Nm)});
  }
  return stop;
}

}  // namespace

TEST_CASE("The maker's plant stops at constant slips as its equations and rig-facts say") {
  const auto [slip, time_s, way_m, tolerance] = GENERATE(table<double, double, double, double>({
      {0.05, 1.44, 12.1, 0.02},
      {0.10, 1.27, 10.7, 0.02},
      {0.15, 1.245, 10.49, 0.02},
      {0.20, 1.246, 10.49, 0.02},
      {1.0, 1.28, 10.8, 0.03},
  }));
  const double end_w2 = 0.1 / r2;
  const Stop stop = stop_at(slip, end_w2);
  const ConstantSlip exact(slip);
  INFO("slip " << slip << ": " << stop.time_s << " s, " << stop.way_m << " m; slip error " << stop.slip_error);
  CHECK_THAT(stop.time_s, WithinRel(time_s, tolerance));
  CHECK_THAT(stop.way_m, WithinRel(way_m, tolerance));
  CHECK_THAT(stop.time_s, WithinRel(exact.time_s(170.0, end_w2), 1e-3));
  CHECK_THAT(stop.way_m, WithinRel(exact.way_m(170.0, end_w2), 1e-3));
  CHECK(stop.slip_error < 2e-3);
}

TEST_CASE("Holding slip 0.15 takes about 4.24 N m on the maker's plant, a duty of 0.686") {
  const double torque_Nm = ConstantSlip(0.15).brake_torque_Nm(85.0);
  CHECK_THAT(torque_Nm, WithinAbs(4.24, 0.01));
  CHECK_THAT((torque_Nm + 6.21) / 15.24, WithinAbs(0.686, 1e-3));
}

TEST_CASE("On the maker's plant, too, J1 w1 / r1 + J2 w2 / r2 is conserved under the tyre force alone") {
  PlantOptions options = inteco_manual();
  auto& w = options.rig.wheels;
  w.d1_Nms_rad = w.d2_Nms_rad = w.M10_Nm = w.M20_Nm = 0.0;
  const auto momentum = [](const PlantState& s) { return J1 * s.omega1_rad_s / r1 + J2 * s.omega2_rad_s / r2; };
  const auto [omega1_rad_s, omega2_rad_s] =
      GENERATE(table<double, double>({{20.0, 160.0}, {160.0, 20.0}, {-30.0, 90.0}, {100.0, 0.0}, {90.0, -5.0}}));
  Plant plant(options);
  plant.reset({.omega1_rad_s = omega1_rad_s, .omega2_rad_s = omega2_rad_s});
  const double start = momentum(plant.state());
  for (int tick = 0; tick < 1500; ++tick) {
    plant.advance(1e-3, {});
    REQUIRE_THAT(momentum(plant.state()), WithinRel(start, 1e-11));
  }
  CHECK(std::abs(plant.slip()) < 5e-4);  // the curve is flat at 0, so the slip decays as 1 / t
}

TEST_CASE("Without the motor the maker's plant never gains energy") {
  std::mt19937_64 generator(20240608);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() >> 11U) * 0x1p-53;
  };
  for (int trial = 0; trial < 200; ++trial) {
    PlantOptions options = inteco_manual();
    if (trial % 2 != 0) options.tyre = "magic-formula";
    options.lever.Mg_Nm = between(1.0, 40.0);
    options.lever.phi_deg = between(40.0, 90.0);
    options.friction_profile = trial % 3 == 0 ? "time: 1; 0.3 at 0.021; 1.2 from 0.05 to 0.09" : "";
    Plant plant(options);
    const double scale = trial % 3 == 1 ? 0.5 : 150.0;
    plant.reset({.omega1_rad_s = between(-scale, scale),
                 .omega2_rad_s = trial % 5 == 0 ? 0.0 : between(-scale, scale),
                 .brake_torque_Nm = between(0.0, 9.0)});
    INFO("trial " << trial);
    require_energy_never_rises(plant, J1, J2, between);
  }
}

TEST_CASE("The maker's plant locks and stays at exactly 0; if the brake is released earlier, it breaks away") {
  Plant plant(inteco_manual());
  plant.reset(rolling_at_170);
  check_locks_then_stands(plant, 2000);

  // From 9 N m the brake's lag needs log(9 / 3.29532) / c31 to fall to M1 = r1 F - M10.
  plant.reset({.omega2_rad_s = 100.0, .brake_torque_Nm = 9.0});
  const double break_away_s = std::log(9.0 / (0.0995 * 33.15095163929526 - 0.0032)) / 20.37;
  plant.advance(break_away_s - 1e-6, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
  plant.advance(0.35, {});
  CHECK(plant.slip() < 0.01);
}

TEST_CASE("The motor drives the upper wheel through the maker's contact, and in traction the force reverses") {
  Plant plant(inteco_manual());
  int ticks = 0;
  while (plant.state().omega1_rad_s < 170.0 && ticks < 10000) {
    plant.advance(1e-3, {.motor_duty = 1.0});
    ++ticks;
  }
  CHECK_THAT(1e-3 * ticks + 0.05, WithinAbs(6.2, 0.1));
  CHECK(plant.slip() > 0.0);  // the lower wheel is ahead, as in braking
  plant.reset({.omega1_rad_s = 100.0, .omega2_rad_s = 60.0});
  CHECK(plant.tyre_force_N() < 0.0);
  plant.advance(1e-3, {});
  CHECK(plant.state().omega1_rad_s < 100.0);
  CHECK(plant.state().omega2_rad_s > 60.0);
}

TEST_CASE("The step is stable and small enough on the maker's plant, down to standstill") {
  struct Case {
    const char* name;
    PlantState start;
    double duty;
    double tolerance_rad_s;
  };
  const auto c =
      GENERATE(Case{"held at the knee", rolling_at_170, 0.65, 1e-5}, Case{"into a lock", rolling_at_170, 1.0, 1e-5},
               Case{"from a walking pace", {.omega1_rad_s = 20.0, .omega2_rad_s = 20.0}, 0.6, 1e-5},
               Case{"in traction", {.omega1_rad_s = 60.0, .omega2_rad_s = 20.0}, 0.0, 1e-5});
  PlantOptions options = inteco_manual();
  Plant plant(options);
  options.max_step_s = 2e-6;
  Plant reference(options);
  plant.reset(c.start);
  reference.reset(c.start);
  double worst_rad_s = 0.0;
  for (int tick = 0; tick < 1500 && reference.state().omega2_rad_s > 0.0; ++tick) {
    plant.advance(1e-3, {.brake_duty = c.duty});
    reference.advance(1e-3, {.brake_duty = c.duty});
    worst_rad_s = std::max({worst_rad_s, std::abs(plant.state().omega1_rad_s - reference.state().omega1_rad_s),
                            std::abs(plant.state().omega2_rad_s - reference.state().omega2_rad_s)});
  }
  INFO(c.name << ": " << worst_rad_s << " rad/s");
  CHECK(worst_rad_s < c.tolerance_rad_s);
  CHECK(worst_rad_s > 0.0);
}
