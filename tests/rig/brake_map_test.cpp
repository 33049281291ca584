#include "abs_hil/rig/brake_map.hpp"

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
