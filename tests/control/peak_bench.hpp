#pragma once

#include <algorithm>
#include <random>

#include "control/braking_bench.hpp"

/// What the tests of the laws that look for the peak of the tyre force share.
namespace bench {

/// Below this speed the slip does not count.
inline constexpr double slow_m_s = 3.0;

/// Lag, limits, dead zone and encoders. The controller's tyre parameters are wrong.
inline Setup real_rig() {
  Setup s;
  s.ideal_actuator = false;
  s.encoders = true;
  s.plant_step_s = 1e-4;
  s.plant = s.rig;
  s.rig.tyre = {.theta_N = 3.0, .B = 5.0, .C = 1.1};
  return s;
}

/// Above `slow_m_s`.
inline double largest_slip(const Result& run, double r2_m) {
  double most = 0.0;
  for (const auto& tick : run.ticks) {
    if (r2_m * tick.omega2 > slow_m_s) most = std::max(most, tick.slip);
  }
  return most;
}

/// Uniform numbers, the same with every standard library.
struct Draw {
  std::mt19937_64 random;
  double operator()(double least, double most) {
    return least + (most - least) * static_cast<double>(random() >> 11U) * 0x1p-53;
  }
};

/// Within 10 % of what the controller believes, radii within 1 %.
inline void perturb(abs_hil::rig::RigParameters& rig, Draw& draw) {
  auto& w = rig.wheels;
  auto& b = rig.brake;
  for (double* parameter : {&w.J1_kg_m2, &w.J2_kg_m2, &w.d1_Nms_rad, &w.d2_Nms_rad, &w.M10_Nm, &w.M20_Nm, &b.b1_Nm,
                            &b.b2_Nm, &b.u0, &b.c31_per_s}) {
    *parameter *= draw(0.9, 1.1);
  }
  w.r1_m *= draw(0.99, 1.01);
  w.r2_m *= draw(0.99, 1.01);
}

}  // namespace bench
