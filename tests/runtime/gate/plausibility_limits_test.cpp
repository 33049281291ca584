// Bounds of plausibility follow from the rig's torques and inertias.
#include "runtime/plausibility_limits.hpp"

#include <cmath>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;

TEST_CASE("the bounds are twice what the rig's torques do to its inertias") {
  rig::RigParameters rig;
  rig.encoder_counts_per_rev = 4096;
  const GateOptions options{.overspeed_rad_s = 240.0, .sample_age_max_s = 0.03, .free_slip_max = 0.2};
  const PlausibilityLimits l = plausibility_limits(rig, false, options);
  CHECK(l.enabled);
  CHECK_FALSE(PlausibilityLimits{}.enabled);
  // By hand, from Table 1: r1 theta = 2.2885 N m, b(1) = 9.03, M10 + 240 d1 = 0.0316976; r2 theta = 2.277,
  // motor 2.1122, M20 + 240 d2 = 0.1440232.
  CHECK(l.upper_gain_rad_s2 == Approx(2.0 * 2.2885 / 7.54e-3));
  CHECK(l.upper_loss_rad_s2 == Approx(2.0 * (2.2885 + 9.03 + 0.0316976) / 7.54e-3));
  CHECK(l.lower_gain_rad_s2 == Approx(2.0 * (2.277 + 2.1122) / 25.6e-3));
  CHECK(l.lower_loss_rad_s2 == Approx(2.0 * (2.277 + 0.1440232) / 25.6e-3));
  CHECK(l.released_brake_Nm == Approx(2.2885 / 8.0));
  CHECK(l.rad_per_count == Approx(6.283185307 / 4096.0));
  CHECK(l.overspeed_rad_s == 240.0);
  CHECK(l.sample_age_max_s == 0.03);
  CHECK(l.free_slip_max == 0.2);
  CHECK_FALSE(l.ideal_actuator);
  CHECK(l.wheels.J1_kg_m2 == rig.wheels.J1_kg_m2);
  CHECK(l.brake.b1_Nm == rig.brake.b1_Nm);
  CHECK(l.motor.stall_torque_Nm == rig.motor.stall_torque_Nm);
  const PlausibilityLimits ideal = plausibility_limits(rig, true, options);
  CHECK(ideal.ideal_actuator);
  CHECK(std::isinf(ideal.upper_loss_rad_s2));
}
