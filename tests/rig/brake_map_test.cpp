// The brake's static map (7) and its inverse.
#include "abs_hil/rig/brake_map.hpp"

#include <cmath>
#include <limits>

#include "catch.hpp"

using namespace abs_hil::rig;
using Catch::Matchers::WithinAbs;

TEST_CASE("brake map (7): line above the dead zone, nothing below") {
  const BrakeParameters brake;
  CHECK(brake_torque_at(brake, 0.0) == 0.0);
  CHECK(brake_torque_at(brake, 0.4149) == 0.0);
  CHECK_THAT(brake_torque_at(brake, 0.415), WithinAbs(15.24 * 0.415 - 6.21, 1e-12));
  CHECK_THAT(brake_torque_at(brake, 1.0), WithinAbs(9.03, 1e-12));
}

TEST_CASE("a map whose line is below zero at u0 gives no negative torque") {
  const BrakeParameters brake{.b1_Nm = 10.0, .b2_Nm = -6.0, .u0 = 0.5, .c31_per_s = 20.0};
  CHECK(brake_torque_at(brake, 0.55) == 0.0);
  CHECK_THAT(brake_torque_at(brake, 0.7), WithinAbs(1.0, 1e-12));
}

TEST_CASE("the inverse gives back every torque the brake can hold") {
  const BrakeParameters brake;
  for (double torque_Nm = brake_torque_at(brake, brake.u0); torque_Nm <= 9.03; torque_Nm += 0.01) {
    CHECK_THAT(brake_torque_at(brake, brake_duty_for(brake, torque_Nm)), WithinAbs(torque_Nm, 1e-9));
  }
}

TEST_CASE("outside its reach the inverse gives the nearest duty") {
  const BrakeParameters brake;
  const double least_Nm = brake_torque_at(brake, brake.u0);
  CHECK(brake_duty_for(brake, -1.0) == 0.0);
  CHECK(brake_duty_for(brake, 0.49 * least_Nm) == 0.0);
  CHECK(brake_duty_for(brake, 0.51 * least_Nm) == brake.u0);
  CHECK(brake_duty_for(brake, 100.0) == 1.0);
  CHECK(brake_duty_for(brake, 100.0, 0.7) == 0.7);
}

TEST_CASE("on a PWM's grid the inverse gives the duty with the nearest torque, and none inside the dead zone") {
  for (const std::uint32_t steps : {4095U, 255U, 10000U}) {
    for (double u0 = 0.40; u0 < 0.6501; u0 += 0.005) {
      const BrakeParameters brake{.u0 = u0};
      for (const double max_duty : {1.0, 0.7}) {
        CAPTURE(steps, u0, max_duty);
        for (double torque_Nm = -0.5; torque_Nm <= 10.0; torque_Nm += 0.0137) {
          const double duty = brake_duty_for(brake, torque_Nm, max_duty, steps);
          // By search over every duty that the PWM can give.
          double nearest_Nm = std::abs(torque_Nm);
          for (std::uint32_t width = 1; width <= steps; width += steps > 255 ? 7 : 1) {
            const double candidate = static_cast<double>(width) / steps;
            if (candidate > max_duty || candidate < u0) continue;
            nearest_Nm = std::min(nearest_Nm, std::abs(brake_torque_at(brake, candidate) - torque_Nm));
          }
          REQUIRE(std::abs(brake_torque_at(brake, duty) - torque_Nm) <= nearest_Nm + 1e-9);
          REQUIRE((duty == 0.0 || duty >= u0));
          REQUIRE(duty <= max_duty);
          REQUIRE(duty == static_cast<double>(std::lround(duty * steps)) / steps);
        }
      }
    }
  }
}

TEST_CASE("a dead zone that reaches beyond the largest duty leaves no torque to give") {
  CHECK(brake_duty_for({.u0 = 0.8}, 9.0, 0.7, 4095) == 0.0);
  CHECK(brake_duty_for({.u0 = 0.8}, 9.0, 0.7) == 0.0);
}

TEST_CASE("a torque that is not finite becomes no duty") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double torque_Nm : {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity}) {
    CHECK(std::isnan(brake_duty_for({}, torque_Nm)));
    CHECK(std::isnan(brake_duty_for({}, torque_Nm, 0.7, 4095)));
  }
}
