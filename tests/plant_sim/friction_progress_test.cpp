// Friction that changes over time or distance acts at its very instant or place.
#include <algorithm>
#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

// Most of these tests lock the upper wheel over a lower one without viscous friction. With slip 1 the deceleration is
// a1 m + a0 for a friction m, and speed and distance have closed forms along any profile.
namespace {

constexpr double locking_Nm = 50.0;
const double force_N = 23.0 * std::sin(1.68 * std::atan(28.0));  ///< of Table 1 at slip 1
const double a1 = 0.0990 * force_N / 25.60e-3;
constexpr double a0 = 0.0925 / 25.60e-3;

PlantOptions locked_on(const char* profile) {
  PlantOptions options;
  options.rig.wheels.d2_Nms_rad = 0.0;
  options.ideal_actuator = true;
  options.friction_profile = profile;
  return options;
}

constexpr PlantState locked_at_170{.omega2_rad_s = 170.0};
constexpr PlantInput locking{.brake_torque_Nm = locking_Nm};

}  // namespace

TEST_CASE("A jump in time acts at its instant, between ticks and within one step, for any division of the time") {
  Plant plant(locked_on("time: 1; 0.4 at 0.1003217; 2 at 0.1003219"));
  const double tick_s = GENERATE(1e-3, 0.37e-3, 0.25);
  plant.reset(locked_at_170);
  double passed_s = 0.0;
  while (passed_s + tick_s < 0.3) {
    plant.advance(tick_s, locking);
    passed_s += tick_s;
  }
  plant.advance(0.3 - passed_s, locking);
  const double mean = 0.1003217 + 0.4 * 2e-7 + 2.0 * (0.3 - 0.1003219);
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(170.0 - a0 * 0.3 - a1 * mean, 1e-10));
  CHECK(plant.friction() == 2.0);
}

TEST_CASE("A ramp in time is a straight line, and the reported truth follows it") {
  Plant plant(locked_on("time: 1; 0.5 from 0.1 to 0.3"));
  plant.reset(locked_at_170);
  plant.advance(0.15, locking);
  CHECK_THAT(plant.friction(), WithinAbs(0.875, 1e-12));
  CHECK_THAT(plant.truth().theta_N, WithinRel(0.875 * 23.0, 1e-12));
  CHECK_THAT(plant.tyre_force_N(), WithinRel(0.875 * force_N, 1e-12));
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(170.0 - a0 * 0.15 - a1 * (0.1 + 0.05 * 0.9375), 1e-10));
  plant.advance(0.25, locking);
  CHECK(plant.friction() == 0.5);
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(170.0 - a0 * 0.4 - a1 * (0.1 + 0.2 * 0.75 + 0.1 * 0.5), 1e-10));
}

TEST_CASE("A patch over the distance begins and ends at its position") {
  // w^2 falls by 2 a for each rad; the patch is from 0.8 to 1.7 m.
  Plant plant(locked_on("distance: 1; 0.3 at 0.8; 1 at 1.7"));
  plant.reset({.angle2_rad = 77.0, .omega2_rad_s = 170.0});
  const auto speed_at = [](double way_m) {
    const double off_m = std::min(way_m, 0.8) + std::max(0.0, way_m - 1.7);
    const double on_m = way_m - off_m;
    return std::sqrt(170.0 * 170.0 - 2.0 * ((a1 + a0) * off_m + (0.3 * a1 + a0) * on_m) / 0.0990);
  };
  for (int tick = 0; tick < 200; ++tick) {
    plant.advance(1e-3, locking);
    const double way_m = 0.0990 * (plant.state().angle2_rad - 77.0);
    REQUIRE_THAT(plant.state().omega2_rad_s, WithinAbs(speed_at(way_m), 1e-9));
    REQUIRE(plant.friction() == (way_m >= 0.8 && way_m < 1.7 ? 0.3 : 1.0));
  }
  CHECK(0.0990 * (plant.state().angle2_rad - 77.0) > 2.0);
}

TEST_CASE("A ramp over the distance is a straight line over the distance") {
  Plant plant(locked_on("distance: 1; 0.2 from 1 to 3"));
  plant.reset(locked_at_170);
  plant.advance(0.12, locking);
  const double way_m = 0.0990 * plant.state().angle2_rad;
  REQUIRE(way_m > 1.5);
  REQUIRE(way_m < 3.0);
  const double friction = 1.0 - 0.4 * (way_m - 1.0);
  CHECK_THAT(plant.friction(), WithinAbs(friction, 1e-12));
  const double mean = 1.0 + (way_m - 1.0) * 0.5 * (1.0 + friction);
  CHECK_THAT(plant.state().omega2_rad_s,
             WithinAbs(std::sqrt(170.0 * 170.0 - 2.0 * (a1 * mean + a0 * way_m) / 0.0990), 1e-9));
  plant.advance(0.3, locking);
  CHECK(plant.friction() == 0.2);
}

TEST_CASE("A braking profile counts from the first brake torque, and a reset restarts it") {
  const bool in_time = GENERATE(true, false);
  Plant plant(locked_on(in_time ? "braking time: 1; 0.5 at 0.1" : "braking distance: 1; 0.5 at 1.6"));
  for (int run = 0; run < 2; ++run) {
    plant.reset(rolling_at_170);
    plant.advance(5.0, {});
    CHECK(plant.friction() == 1.0);
    const double start_rad = plant.state().angle2_rad;
    plant.advance(0.05, {.brake_torque_Nm = 0.1});
    plant.advance(0.03, {});  // counting continues
    plant.advance(0.015, locking);
    CHECK(plant.friction() == 1.0);
    plant.advance(0.015, locking);
    CHECK(plant.friction() == 0.5);
    CHECK(0.0990 * (plant.state().angle2_rad - start_rad) > 1.6);
  }
}

TEST_CASE("With the real actuator a duty in the dead zone does not count as braking") {
  PlantOptions options;
  options.friction_profile = "braking time: 1; 0.5 at 0.1";
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(1.0, {.brake_duty = 0.4});
  CHECK(plant.friction() == 1.0);
  plant.advance(0.2, {.brake_duty = 0.5});
  CHECK(plant.friction() == 0.5);
}

TEST_CASE("Pieces end by time also while both wheels stand") {
  Plant plant(locked_on("time: 1; 0.5 at 10; 0.7 at 20"));
  plant.advance(15.0, {});
  CHECK(plant.friction() == 0.5);
  CHECK(plant.truth().theta_N == 11.5);
  plant.advance(1e6, {});
  CHECK(plant.friction() == 0.7);
}

TEST_CASE("A held wheel breaks away where the road gains grip, and is held again where the road loses it") {
  PlantOptions options = locked_on("time: 0.5; 1 at 0.0102; 0.5 at 0.0304");
  options.rig.wheels.M10_Nm = 0.75 * 0.0995 * force_N;
  Plant plant(options);
  plant.reset(locked_at_170);
  plant.advance(0.0102, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
  plant.advance(0.0002, {});
  CHECK_THAT(plant.state().omega1_rad_s, WithinRel(0.25 * 0.0995 * force_N / 7.54e-3 * 0.0002, 1e-3));
  plant.advance(0.02, {});
  CHECK(plant.state().omega1_rad_s > 0.5);
  plant.advance(1.0, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
}

TEST_CASE("The order of convergence survives jumps and corners of the friction, in time and over distance") {
  PlantOptions options;
  options.friction_profile = GENERATE("time: 1; 0.6 at 0.0313; 1 at 0.0777", "time: 1; 0.6 from 0.0213 to 0.0471",
                                      "distance: 1; 0.6 at 0.513; 1 at 1.1", "distance: 1; 0.6 from 0.413 to 0.91");
  const auto end = [&](double max_step_s) {
    options.max_step_s = max_step_s;
    Plant plant(options);
    plant.reset(rolling_at_170);
    plant.advance(0.128, {.brake_duty = 0.505});
    return plant.state().omega1_rad_s;
  };
  const double reference = end(10e-6);
  const double coarse = std::abs(end(2e-3) - reference);
  const double fine = std::abs(end(0.5e-3) - reference);
  INFO(options.friction_profile << ": " << coarse << " " << fine << " rad/s");
  CHECK(std::log2(coarse / fine) > 2 * 3.5);
  CHECK(fine < 1e-7);
}

TEST_CASE("A profile of 1 changes nothing, bit by bit") {
  PlantOptions options;
  Plant plain(options);
  options.friction_profile = "time: 1";
  Plant profiled(options);
  for (Plant* plant : {&plain, &profiled}) {
    plant->reset(rolling_at_170);
    for (int tick = 0; tick < 500; ++tick) plant->advance(1e-3, {.brake_duty = 0.6});
  }
  CHECK(plain.state().omega1_rad_s == profiled.state().omega1_rad_s);
  CHECK(plain.state().omega2_rad_s == profiled.state().omega2_rad_s);
}
