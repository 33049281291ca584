// A plain Euler integration of the equations agrees with the plant.
#include <algorithm>
#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"
#include "rigs.hpp"

// A second plant, written from the paper with Table 1's numbers and without code of the project: plain Euler steps of 1
// us; a wheel that would pass zero is clamped there.
namespace {

struct EulerRig {
  double w1, w2, Tb, way1;

  void step(double dt, double u, double um) {
    const double v = 0.0990 * w2;
    const double slip = (v - 0.0995 * w1) / std::max(v, 0.02);
    const double F = 23.0 * std::sin(1.68 * std::atan(28.0 * slip));
    const double b = u >= 0.415 ? 15.24 * u - 6.21 : 0.0;
    const double motor = 2.1122 * um * (1.0 - w2 / 220.0);
    const double dry1 = 0.0032 + Tb;
    const bool held1 = w1 == 0.0 && std::abs(0.0995 * F) <= dry1;
    const bool held2 = w2 == 0.0 && std::abs(motor - 0.0990 * F) <= 0.0925;
    const double dw1 = held1 ? 0.0 : (0.0995 * F - 118.74e-6 * w1 - dry1) / 7.54e-3;
    const double dw2 = held2 ? 0.0 : (-0.0990 * F - 214.68e-6 * w2 - 0.0925 + motor) / 25.60e-3;
    way1 += dt * w1;
    w1 = std::max(0.0, w1 + dt * dw1);
    w2 = std::max(0.0, w2 + dt * dw2);
    Tb += dt * 20.37 * (b - Tb);
  }
};

}  // namespace

using namespace abs_hil::plant_sim;

TEST_CASE("A plain Euler integration with 1 us steps agrees, through lock, release and standstill") {
  struct Leg {
    double until_s, brake_duty, motor_duty;
  };
  const Leg legs[] = {{0.3, 0.0, 1.0}, {0.6, 0.505, 0.0}, {0.9, 1.0, 0.0}, {1.3, 0.42, 0.0}, {3.0, 0.6, 0.0}};
  EulerRig euler{100.0, 100.0, 0.0, 0.0};
  Plant plant{PlantOptions{}};
  plant.reset({.omega1_rad_s = 100.0, .omega2_rad_s = 100.0});
  double worst_rad_s = 0.0;
  bool locked = false;
  bool released = false;
  int tick = 0;
  for (const Leg& leg : legs) {
    for (; tick < static_cast<int>(std::lround(leg.until_s * 1e3)); ++tick) {
      for (int i = 0; i < 1000; ++i) euler.step(1e-6, leg.brake_duty, leg.motor_duty);
      plant.advance(1e-3, {.motor_duty = leg.motor_duty, .brake_duty = leg.brake_duty});
      const PlantState& s = plant.state();
      worst_rad_s = std::max({worst_rad_s, std::abs(s.omega1_rad_s - euler.w1), std::abs(s.omega2_rad_s - euler.w2)});
      if (s.omega1_rad_s == 0.0 && s.omega2_rad_s > 5.0) locked = true;
      if (locked && s.omega1_rad_s > 5.0) released = true;
    }
  }
  INFO("worst difference " << worst_rad_s << " rad/s");
  CHECK(worst_rad_s < 2e-3);
  CHECK(locked);
  CHECK(released);
  CHECK(plant.state().omega2_rad_s == 0.0);
  CHECK(euler.w2 == 0.0);
  CHECK(std::abs(plant.state().angle1_rad - euler.way1) < 2e-3);
}
