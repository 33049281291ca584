#pragma once

#include <cstdint>

#include "abs_hil/rig/option.hpp"

namespace abs_hil::rig {

/// Both wheels: geometry, inertia and bearing friction (paper, Table 1). Index 1 is the upper, braked "car" wheel,
/// index 2 the lower wheel that stands for the road and the car's mass.
struct WheelParameters {
  ABS_HIL_OPTIONS(WheelParameters);
  bool operator==(const WheelParameters&) const = default;
  ABS_HIL_OPTION(double, r1_m, 0.0995, .unit = "m", .meaning = "upper wheel radius", .range = between(0.01, 1),
                 .on_rig = "caliper, or the length that the rim covers in ten turns over 20 pi");
  ABS_HIL_OPTION(double, r2_m, 0.0990, .unit = "m", .meaning = "lower wheel radius", .range = between(0.01, 1),
                 .on_rig = "as r1_m; an error of one radius against the other shifts every slip");
  ABS_HIL_OPTION(
      double, J1_kg_m2, 7.54e-3, .unit = "kg m^2", .meaning = "upper wheel moment of inertia",
      .range = between(1e-4, 100),
      .on_rig = "lifted upper wheel: known brake torque over deceleration; or computed from drawing and mass");
  ABS_HIL_OPTION(double, J2_kg_m2, 25.60e-3, .unit = "kg m^2", .meaning = "lower wheel moment of inertia",
                 .range = between(1e-4, 1000), .on_rig = "computed from drawing and mass, or swung as a pendulum");
  ABS_HIL_OPTION(double, d1_Nms_rad, 118.74e-6, .unit = "N m s/rad", .meaning = "upper wheel viscous friction",
                 .range = from_zero(0.1),
                 .on_rig = "run-out of the lifted upper wheel: slope of deceleration over speed, times J1");
  ABS_HIL_OPTION(
      double, d2_Nms_rad, 214.68e-6, .unit = "N m s/rad", .meaning = "lower wheel viscous friction",
      .range = from_zero(0.1),
      .on_rig = "run-out of the lower wheel, the upper one lifted: slope of deceleration over speed, times J2");
  ABS_HIL_OPTION(double, M10_Nm, 0.0032, .unit = "N m", .meaning = "upper wheel Coulomb friction",
                 .range = from_zero(10),
                 .on_rig = "run-out of the lifted upper wheel: deceleration just before it stops, times J1");
  ABS_HIL_OPTION(
      double, M20_Nm, 0.0925, .unit = "N m", .meaning = "lower wheel Coulomb friction", .range = from_zero(10),
      .on_rig = "run-out of the lower wheel, the upper one lifted: deceleration just before it stops, times J2");
};

/// Tyre force Ft = theta * phi(slip) of (10), phi(slip) = sin(C atan(B slip)).
struct TyreParameters {
  ABS_HIL_OPTIONS(TyreParameters);
  bool operator==(const TyreParameters&) const = default;
  ABS_HIL_OPTION(double, theta_N, 23.0, .unit = "N",
                 .meaning = "peak tyre force, theta = mu D of (10); a plant with load lever does not use it",
                 .range = positive(1e5),
                 .on_rig = "largest braking force while the slip rises slowly: experiment slip-sweep");
  ABS_HIL_OPTION(double, B, 28.0, .meaning = "tyre stiffness factor of (4)", .range = positive(200),
                 .on_rig = "initial slope of force over slip, divided by theta and C: experiment slip-sweep");
  /// Above 2 the force would change sign at large slip.
  ABS_HIL_OPTION(double, C, 1.68, .meaning = "tyre shape factor of (4)", .range = positive(2),
                 .on_rig = "force of a locked wheel over theta is nearly sin(C pi/2): experiment slip-sweep");
};

/// Brake: static map (7) from duty to torque, dead times, first-order lag (6), and the fastest change of the torque.
struct BrakeParameters {
  ABS_HIL_OPTIONS(BrakeParameters);
  bool operator==(const BrakeParameters&) const = default;
  ABS_HIL_OPTION(double, b1_Nm, 15.24, .unit = "N m", .meaning = "slope of the brake map (7)", .range = positive(1e5),
                 .on_rig = "steady brake torque at several duties, by a spring balance at the rim: slope over duty");
  ABS_HIL_OPTION(double, b2_Nm, -6.21, .unit = "N m", .meaning = "offset of the brake map (7)",
                 .range = between(-1e5, 1e5), .on_rig = "the same line: its value at duty 0, below zero");
  ABS_HIL_OPTION(double, u0, 0.415, .meaning = "brake duty below which there is no torque (7)",
                 .range = from_zero_below(1),
                 .on_rig = "raise the brake duty slowly until the turning wheel slows down");
  ABS_HIL_OPTION(
      double, c31_per_s, 20.37, .unit = "1/s", .meaning = "inverse time constant of the brake (6)",
      .range = positive(1000),
      .on_rig = "1 over the time in which the brake torque reaches 63 % after a step: experiment brake-step");
  ABS_HIL_OPTION(double, brake_rate_limit_Nm_s, 0.0, .unit = "N m/s",
                 .meaning = "fastest change of the brake torque; 0: none but the lag", .range = from_zero(1e6),
                 .on_rig = "slope of the brake torque after the largest step of duty: experiment brake-step");
  ABS_HIL_OPTION(double, brake_dead_time_s, 0.0, .unit = "s",
                 .meaning = "time after which the brake follows a change of its duty", .range = from_zero(0.2),
                 .on_rig = "from a step of duty to the wheel's first change of speed: experiment brake-step");
  /// Of the dead time, so that one that is changed moves both edges.
  ABS_HIL_OPTION(double, brake_release_lead_s, 0.0, .unit = "s",
                 .meaning = "how much sooner than that it follows a smaller duty", .range = from_zero(0.2),
                 .on_rig = "the dead time less the time from duty 0 until the wheel spins up again");
};

/// Eccentricity of an encoder's disc: it reads angle + eccentricity sin(angle + phase).
struct EccentricityParameters {
  ABS_HIL_OPTIONS(EccentricityParameters);
  bool operator==(const EccentricityParameters&) const = default;
  ABS_HIL_OPTION(double, eccentricity_rad, 0.0, .unit = "rad",
                 .meaning = "encoder's largest error of the angle by its eccentricity", .range = from_zero(0.1),
                 .on_rig = "fitted while the wheels coast: control.observer.learn_eccentricity_s");
  ABS_HIL_OPTION(double, phase_rad, 0.0, .unit = "rad",
                 .meaning = "angle of the encoder's disc from its zero of that error, at count 0",
                 .range = between(-6.2831853071795862, 6.2831853071795862), .on_rig = "as its eccentricity_rad");
};

/// Lower wheel's DC motor: Tm = stall_torque * duty * (1 - omega2 / no_load_speed). The paper does not give these
/// values, so they are calibrated. In the paper's plots braking starts at about 6.2 s from omega1 = 170 rad/s, and the
/// motor is off for the last 0.05 s. The no-load speed is set to 220 rad/s (170 rad/s is 0.78 of it). The stall torque
/// is then the value for which full duty from rest brings the upper wheel to 170 rad/s in 6.15 s, found by bisection on
/// the simulated plant of Table 1. The lumped model without slip, J w' = K - M - (K/w0 + d) w with both wheels' J, d, M
/// referred to the lower one, gives 2.1077 N m in closed form; slip in traction explains the difference.
/// tests/plant_sim/actuators_test.cpp checks both.
///
/// A rig may start its motor through resistors, one or two, which it bridges at a speed each (Inteco's card, registers
/// 90 to A0): below `start_until_rad_s` the stall torque is `start_torque_Nm`, from there to `middle_until_rad_s` it is
/// `middle_torque_Nm`. A speed of 0: there is no such resistor.
struct DriveMotorParameters {
  ABS_HIL_OPTIONS(DriveMotorParameters);
  bool operator==(const DriveMotorParameters&) const = default;
  ABS_HIL_OPTION(double, stall_torque_Nm, 2.1122, .unit = "N m",
                 .meaning = "drive motor's torque at standstill and full duty", .range = positive(100),
                 .on_rig = "acceleration from rest at full duty times both inertias, plus friction");
  /// Speed at which the back-EMF cancels the supply.
  ABS_HIL_OPTION(double, no_load_speed_rad_s, 220.0, .unit = "rad/s", .meaning = "drive motor's no-load speed",
                 .range = positive(2000),
                 .on_rig = "final speed at full duty with the upper wheel lifted, corrected for friction");
  ABS_HIL_OPTION(double, start_torque_Nm, 0.0, .unit = "N m",
                 .meaning = "stall torque while the start resistors are in the motor's circuit",
                 .range = from_zero(100),
                 .on_rig = "as stall_torque_Nm, below the speed at which the slope of the run-up jumps");
  ABS_HIL_OPTION(double, start_until_rad_s, 0.0, .unit = "rad/s",
                 .meaning = "lower wheel's speed that bridges a start resistor; 0: there is none",
                 .range = from_zero(2000), .on_rig = "speed at which the slope of the run-up jumps");
  ABS_HIL_OPTION(double, middle_torque_Nm, 0.0, .unit = "N m",
                 .meaning = "the same while the second of two start resistors is left", .range = from_zero(100),
                 .on_rig = "as start_torque_Nm, between two jumps");
  ABS_HIL_OPTION(double, middle_until_rad_s, 0.0, .unit = "rad/s",
                 .meaning = "lower wheel's speed that bridges the second of two; 0: there is none",
                 .range = from_zero(2000), .on_rig = "as start_until_rad_s, the second jump");
};

/// The stall torque at a speed of the lower wheel, N m: that of the resistors which are still in the circuit. Real-time
/// safe.
[[nodiscard]] constexpr double stall_torque_Nm(const DriveMotorParameters& motor, double omega2_rad_s) noexcept {
  if (omega2_rad_s < motor.start_until_rad_s) return motor.start_torque_Nm;
  return omega2_rad_s < motor.middle_until_rad_s ? motor.middle_torque_Nm : motor.stall_torque_Nm;
}

/// All parameters of the rig that a controller may use, in SI units: of the simulated rig, or of the model of a rig.
struct RigParameters {
  ABS_HIL_OPTIONS(RigParameters);
  bool operator==(const RigParameters&) const = default;
  ABS_HIL_GROUP(TyreParameters, tyre, "", {});
  ABS_HIL_GROUP(WheelParameters, wheels, "", {});
  ABS_HIL_GROUP(BrakeParameters, brake, "", {});
  ABS_HIL_GROUP(DriveMotorParameters, motor, "motor_", {});
  /// After quadrature decoding.
  ABS_HIL_OPTION(std::int32_t, encoder_counts_per_rev, 4096, .meaning = "encoder counts per revolution",
                 .range = between(4, 1'000'000),
                 .on_rig = "turn each wheel once by hand: abs_hil commission counts; 4 times the lines of the disc");
  ABS_HIL_GROUP(EccentricityParameters, upper_encoder, "upper_encoder_", {});
  ABS_HIL_GROUP(EccentricityParameters, lower_encoder, "lower_encoder_", {});
};

}  // namespace abs_hil::rig
