// The tyre's curve (4) and the slip (5).
#include "abs_hil/rig/tyre_curve.hpp"

#include "catch.hpp"

using namespace abs_hil::rig;
using Catch::Matchers::WithinAbs;

TEST_CASE("tyre curve of Table 1: the values theory gives") {
  const TyreParameters tyre;
  CHECK_THAT(normalised_tyre_force(tyre, 0.15), WithinAbs(0.7804, 5e-5));
  CHECK_THAT(peak_slip(tyre), WithinAbs(0.0484, 5e-5));
  CHECK_THAT(normalised_tyre_force(tyre, peak_slip(tyre)), WithinAbs(1.0, 1e-12));
  CHECK(normalised_tyre_force(tyre, 0.0) == 0.0);
}

TEST_CASE("tyre curve is odd and nowhere above its peak") {
  const TyreParameters tyre;
  for (double slip = 0.0; slip <= 2.0; slip += 0.001) {
    CHECK(normalised_tyre_force(tyre, -slip) == -normalised_tyre_force(tyre, slip));
    CHECK(normalised_tyre_force(tyre, slip) <= 1.0);
  }
}

TEST_CASE("a curve with C <= 1 has its largest force at a locked wheel") {
  CHECK(peak_slip({.theta_N = 23.0, .B = 10.0, .C = 1.0}) == 1.0);
}

TEST_CASE("slip (5): free rolling, locked, traction, standstill") {
  CHECK(wheel_slip(10.0, 10.0, 0.02) == 0.0);
  CHECK(wheel_slip(0.0, 10.0, 0.02) == 1.0);
  CHECK_THAT(wheel_slip(8.5, 10.0, 0.02), WithinAbs(0.15, 1e-12));
  CHECK(wheel_slip(11.0, 10.0, 0.02) < 0.0);
  CHECK(wheel_slip(0.0, 0.0, 0.02) == 0.0);
  CHECK_THAT(wheel_slip(0.0, 0.01, 0.02), WithinAbs(0.5, 1e-12));
}
