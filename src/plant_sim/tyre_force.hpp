#pragma once

#include <algorithm>
#include <cmath>

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

// The contact between the wheels: the one place that another tyre or load model takes over.
namespace abs_hil::plant_sim {

/// Slip (5) of the upper wheel on the lower, regularised near standstill.
[[nodiscard]] inline double contact_slip(const PlantOptions& options, double omega1_rad_s,
                                         double omega2_rad_s) noexcept {
  const rig::WheelParameters& wheels = options.rig.wheels;
  return rig::wheel_slip(wheels.r1_m * omega1_rad_s, wheels.r2_m * omega2_rad_s, options.slip_regularisation_m_s);
}

/// Tyre force Ft of (10), N: positive when it drives the upper wheel forward and brakes the lower one.
[[nodiscard]] inline double tyre_force_N(const PlantOptions& options, double omega1_rad_s,
                                         double omega2_rad_s) noexcept {
  return options.rig.tyre.theta_N *
         rig::normalised_tyre_force(options.rig.tyre, contact_slip(options, omega1_rad_s, omega2_rad_s));
}

/// The steepest the tyre force can rise with the difference of the circumferential speeds, N s/m: theta B C (the slope
/// of (10) at slip 0) over the car speed. It bounds how stiff the slip dynamics are, whatever the slip is now.
[[nodiscard]] inline double tyre_damping_bound_Ns_m(const PlantOptions& options, double omega2_rad_s) noexcept {
  const rig::TyreParameters& tyre = options.rig.tyre;
  const double v_x_m_s = std::max(std::abs(options.rig.wheels.r2_m * omega2_rad_s), options.slip_regularisation_m_s);
  return tyre.theta_N * tyre.B * tyre.C / v_x_m_s;
}

}  // namespace abs_hil::plant_sim
