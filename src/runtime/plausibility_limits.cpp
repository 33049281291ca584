// Derives the gate's limits from the rig's nominal parameters (docs/safety.md).
#include "runtime/plausibility_limits.hpp"

#include <algorithm>
#include <limits>

#include "abs_hil/rig/brake_map.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::runtime {

PlausibilityLimits plausibility_limits(const rig::RigParameters& rig, bool ideal_actuator, const GateOptions& options) {
  constexpr double margin = 2.0;
  // The least grip is a quarter of theta, and a tyre that slides gives at least half of its peak force.
  constexpr double least_sliding_part = 0.125;
  const rig::WheelParameters& w = rig.wheels;
  const double tyre_N = rig.tyre.theta_N;
  const double brake_Nm =
      ideal_actuator ? std::numeric_limits<double>::infinity() : rig::brake_torque_at(rig.brake, 1.0);
  const rig::DriveMotorParameters& motor = rig.motor;
  const double motor_Nm = std::max(
      {motor.stall_torque_Nm, rig::stall_torque_Nm(motor, 0.0), rig::stall_torque_Nm(motor, motor.start_until_rad_s)});
  const double friction1_Nm = w.M10_Nm + w.d1_Nms_rad * options.overspeed_rad_s;
  const double friction2_Nm = w.M20_Nm + w.d2_Nms_rad * options.overspeed_rad_s;
  return {.enabled = true,
          .rad_per_count = rig::radians_per_count(rig.encoder_counts_per_rev),
          .upper_gain_rad_s2 = margin * w.r1_m * tyre_N / w.J1_kg_m2,
          .upper_loss_rad_s2 = margin * (w.r1_m * tyre_N + brake_Nm + friction1_Nm) / w.J1_kg_m2,
          .lower_gain_rad_s2 = margin * (w.r2_m * tyre_N + motor_Nm) / w.J2_kg_m2,
          .lower_loss_rad_s2 = margin * (w.r2_m * tyre_N + friction2_Nm) / w.J2_kg_m2,
          .released_brake_Nm = least_sliding_part * w.r1_m * tyre_N,
          .overspeed_rad_s = options.overspeed_rad_s,
          .sample_age_max_s = options.sample_age_max_s,
          .free_slip_max = options.free_slip_max,
          .ideal_actuator = ideal_actuator,
          .wheels = w,
          .brake = rig.brake,
          .motor = motor};
}

}  // namespace abs_hil::runtime
