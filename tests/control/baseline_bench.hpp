#pragma once

#include "control/braking_bench.hpp"

/// Helpers of the tests of the baseline controllers, written out independently of the control room.
namespace baseline {

using namespace abs_hil;

/// phi of (10).
inline double phi(const rig::RigParameters& rig, double slip) {
  return std::sin(rig.tyre.C * std::atan(rig.tyre.B * slip));
}

/// k of (15).
inline double gain(const rig::RigParameters& rig, double slip_ref) {
  const auto& w = rig.wheels;
  return w.r1_m * w.r1_m / w.J1_kg_m2 + (1 - slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
}

/// The friction drift of (16).
inline double drift(const rig::RigParameters& rig, const rig::WheelSpeeds& s, double slip_ref) {
  const auto& w = rig.wheels;
  return -w.r1_m / w.J1_kg_m2 * (w.d1_Nms_rad * s.omega1_rad_s + w.M10_Nm) +
         (1 - slip_ref) * w.r2_m / w.J2_kg_m2 * (w.d2_Nms_rad * s.omega2_rad_s + w.M20_Nm);
}

/// An input with the given e_v and car speed, its slip by (5).
inline control::SlipInput input_at(const rig::RigParameters& rig, double omega2, double error, double dt_s,
                                   double slip_ref = 0.15) {
  const auto& w = rig.wheels;
  control::SlipInput in{.dt_s = dt_s, .slip_ref = slip_ref};
  in.speeds.omega2_rad_s = omega2;
  in.speeds.omega1_rad_s = ((1 - slip_ref) * w.r2_m * omega2 - error) / w.r1_m;
  in.slip = 1 - w.r1_m * in.speeds.omega1_rad_s / (w.r2_m * omega2);
  in.max_brake_torque_Nm = std::numeric_limits<double>::infinity();
  return in;
}

}  // namespace baseline
