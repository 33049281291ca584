#pragma once

#include <cstdint>

namespace abs_hil::rig {

/// Both wheels: geometry, inertia and bearing friction (paper, Table 1). Index 1 is the upper, braked "car" wheel,
/// index 2 the lower wheel that stands for the road and the car's mass.
struct WheelParameters {
  double r1_m{0.0995};           ///< upper wheel radius, > 0
  double r2_m{0.0990};           ///< lower wheel radius, > 0
  double J1_kg_m2{7.54e-3};      ///< upper wheel moment of inertia, > 0
  double J2_kg_m2{25.60e-3};     ///< lower wheel moment of inertia, > 0
  double d1_Nms_rad{118.74e-6};  ///< upper wheel viscous friction, >= 0
  double d2_Nms_rad{214.68e-6};  ///< lower wheel viscous friction, >= 0
  double M10_Nm{0.0032};         ///< upper wheel Coulomb (bearing) friction, >= 0
  double M20_Nm{0.0925};         ///< lower wheel Coulomb (bearing) friction, >= 0
};

/// Tyre force Ft = theta * phi(slip) of (10), phi(slip) = sin(C atan(B slip)).
struct TyreParameters {
  double theta_N{23.0};  ///< peak tractive force theta = mu * D, > 0
  double B{28.0};        ///< stiffness factor, > 0
  double C{1.68};        ///< shape factor, in (0, 2]: above 2 the force would change sign at large slip
};

/// Brake: static map (7) from duty to torque, first-order lag (6).
struct BrakeParameters {
  double b1_Nm{15.24};      ///< slope of the map, torque per unit duty, > 0
  double b2_Nm{-6.21};      ///< offset of the map
  double u0{0.415};         ///< dead zone: no torque below this duty, in [0, 1)
  double c31_per_s{20.37};  ///< inverse time constant of the lag, > 0
};

/// Lower wheel's DC motor: Tm = stall_torque * duty * (1 - omega2 / no_load_speed). The paper does not give these
/// values, so they are calibrated. In the paper's plots braking starts at about 6.2 s from omega1 = 170 rad/s, and the
/// motor is off for the last 0.05 s. The no-load speed is set to 220 rad/s (170 rad/s is 0.78 of it). The stall torque
/// is then the value for which full duty from rest brings the upper wheel to 170 rad/s in 6.15 s, found by bisection on
/// the simulated plant of Table 1. The lumped model without slip, J w' = K - M - (K/w0 + d) w with both wheels' J, d, M
/// referred to the lower one, gives 2.1077 N m in closed form; slip in traction explains the difference.
/// tests/plant_sim/actuators_test.cpp checks both.
struct DriveMotorParameters {
  double stall_torque_Nm{2.1122};     ///< torque at standstill and full duty, > 0
  double no_load_speed_rad_s{220.0};  ///< speed at which back-EMF cancels the supply, > 0
};

/// All parameters of the rig that a controller may use, in SI units.
struct RigParameters {
  WheelParameters wheels;
  TyreParameters tyre;
  BrakeParameters brake;
  DriveMotorParameters motor;
  std::int32_t encoder_counts_per_rev{4096};  ///< counts per revolution after quadrature decoding, >= 4
};

/// k(slip_ref) of (15): gain from the tyre force to the derivative of the slip velocity error, 1/kg.
[[nodiscard]] constexpr double slip_velocity_gain(const WheelParameters& w, double slip_ref) noexcept {
  return w.r1_m * w.r1_m / w.J1_kg_m2 + (1.0 - slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
}

}  // namespace abs_hil::rig
