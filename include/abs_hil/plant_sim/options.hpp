#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::plant_sim {

/// Coefficients of the maker's friction curve, mu(s) = w4 s^p / (a + s^p) + w3 s^3 + w2 s^2 + w1 s for a slip s in
/// [0, 1] (Inteco ABS, User's Manual, section 5).
struct IntecoMuParameters {
  ABS_HIL_OPTIONS(IntecoMuParameters);
  ABS_HIL_OPTION(double, w1, -0.04240011450454, .meaning = "simulation: tyre inteco-mu, coefficient of slip",
                 .range = rig::between(-10, 10), .on_rig = "fit of the curve to slip and force: experiment slip-sweep");
  ABS_HIL_OPTION(double, w2, 2.9375e-10, .meaning = "simulation: tyre inteco-mu, coefficient of slip^2",
                 .range = rig::between(-10, 10), .on_rig = "as mu_w1");
  ABS_HIL_OPTION(double, w3, 0.03508217905067, .meaning = "simulation: tyre inteco-mu, coefficient of slip^3",
                 .range = rig::between(-10, 10), .on_rig = "as mu_w1");
  ABS_HIL_OPTION(double, w4, 0.40662691102315, .meaning = "simulation: tyre inteco-mu, height of the saturating term",
                 .range = rig::between(-10, 10), .on_rig = "as mu_w1");
  ABS_HIL_OPTION(double, a, 0.00025724985785,
                 .meaning = "simulation: tyre inteco-mu, slip^p at half of the saturating term",
                 .range = rig::positive(10), .on_rig = "as mu_w1");
  /// Below 1 the curve would rise with infinite slope from slip 0.
  ABS_HIL_OPTION(double, p, 2.09945271667129, .meaning = "simulation: tyre inteco-mu, exponent of the saturating term",
                 .range = rig::between(1, 10), .on_rig = "as mu_w1");
};

/// The lever that carries the upper wheel and presses it onto the lower one (Inteco ABS, User's Manual, section 5).
struct LeverParameters {
  ABS_HIL_OPTIONS(LeverParameters);
  ABS_HIL_OPTION(
      double, Mg_Nm, 19.62, .unit = "N m", .meaning = "simulation: load lever, moment of its weight",
      .range = rig::positive(1000),
      .on_rig = "force of a spring balance that just lifts the upper wheel, times its distance from the pivot");
  ABS_HIL_OPTION(double, L_m, 0.370, .unit = "m", .meaning = "simulation: load lever, from pivot to contact",
                 .range = rig::between(0.01, 10), .on_rig = "tape: from the pivot to the point where the wheels touch");
  ABS_HIL_OPTION(double, phi_deg, 65.61, .unit = "deg",
                 .meaning = "simulation: load lever, angle between its line and the contact's normal",
                 .range = rig::positive(90),
                 .on_rig = "photograph from the side: angle between line L and the normal at the contact");
};

/// Time profiles of factors over the plant's parameters, see FactorProfile; empty: constant 1.
struct DriftProfiles {
  ABS_HIL_OPTIONS(DriftProfiles);
  ABS_HIL_OPTION(std::string, brake_torque, "", .key = "brake_torque_profile",
                 .meaning = "simulation: factor over the brake's torque, over time (docs/plants.md)");
  ABS_HIL_OPTION(std::string, motor_torque, "", .key = "motor_torque_profile",
                 .meaning = "simulation: factor over the motor's torque, over time (docs/plants.md)");
  ABS_HIL_OPTION(std::string, upper_bearing, "", .key = "upper_bearing_profile",
                 .meaning = "simulation: factor over M10 and d1, over time (docs/plants.md)");
  ABS_HIL_OPTION(std::string, lower_bearing, "", .key = "lower_bearing_profile",
                 .meaning = "simulation: factor over M20 and d2, over time (docs/plants.md)");
};

/// What a real brake does beside its map, dead times and lag (docs/plants.md). Without effect on an ideal actuator.
struct BrakeFlaws {
  ABS_HIL_OPTIONS(BrakeFlaws);
  bool operator==(const BrakeFlaws&) const = default;
  static constexpr double rippled_fully_Nm = 3.0;
  ABS_HIL_OPTION(double, hysteresis, 0.0,
                 .meaning = "simulation: share of the torque by which a cable's friction keeps it from b(u)",
                 .range = rig::from_zero(0.5));
  ABS_HIL_OPTION(double, fading_per_J, 0.0, .unit = "1/J",
                 .meaning = "simulation: share of the brake torque lost per joule that the brake has taken",
                 .range = rig::from_zero(0.1));
  ABS_HIL_OPTION(double, cooling_per_s, 0.0, .unit = "1/s",
                 .meaning = "simulation: share of the heat, by which the brake fades, that leaves it per second",
                 .range = rig::from_zero(10));
  ABS_HIL_OPTION(double, curvature, 0.0,
                 .meaning = "simulation: share of b(u) that a small torque lacks; none at duty 1",
                 .range = rig::between(-0.9, 0.9));
  ABS_HIL_OPTION(double, release_ratio, 1.0,
                 .meaning = "simulation: how many times faster the brake lets go than it takes hold",
                 .range = rig::between(0.1, 10));
  /// Above 1 the gate's bounds, which have a factor of 2, would not cover it (docs/safety.md).
  ABS_HIL_OPTION(double, overshoot, 0.0,
                 .meaning = "simulation: share by which the torque at duty 1 is too large as the brake takes hold",
                 .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, overshoot_per_s, 78.0, .unit = "1/s",
                 .meaning = "simulation: rate at which the overshoot fades, and comes back in a released brake",
                 .range = rig::positive(1000));
  /// Its share is constant below `rippled_fully_Nm`, so that the torque stays above 0.
  ABS_HIL_OPTION(double, ripple_Nm, 0.0, .unit = "N m",
                 .meaning = "simulation: amplitude with which the torque swings once a turn of the upper wheel",
                 .range = rig::from_zero(rippled_fully_Nm));
  ABS_HIL_OPTION(double, ripple_phase_rad, 0.0, .unit = "rad",
                 .meaning = "simulation: angle of the upper wheel from the ripple's crest at the start",
                 .range = rig::between(-6.2831853071795862, 6.2831853071795862));
};

/// What a real encoder does beside its steps and its eccentricity (docs/plants.md).
struct EncoderFlaws {
  ABS_HIL_OPTIONS(EncoderFlaws);
  bool operator==(const EncoderFlaws&) const = default;
  ABS_HIL_OPTION(double, slot_error_counts, 0.0,
                 .meaning = "simulation: counts by which every second edge of the encoder's disc comes late",
                 .range = rig::from_zero(0.9));
  ABS_HIL_OPTION(std::int32_t, lost_counts, 0,
                 .meaning = "simulation: counts that one place of the encoder's disc loses in each revolution",
                 .range = rig::between(0, 1000));
};

/// The simulated rig. `rig` holds its true parameters.
struct PlantOptions {
  ABS_HIL_OPTIONS(PlantOptions);
  ABS_HIL_GROUP(rig::RigParameters, rig, "", {});
  /// Without map, lag and saturation.
  ABS_HIL_OPTION(bool, ideal_actuator, false, .meaning = "simulation: the torque asked for acts at once");
  ABS_HIL_OPTION(bool, ideal_sensors, false, .meaning = "simulation: controllers get the true speeds");
  ABS_HIL_OPTION(double, slip_regularisation_m_s, 0.02, .unit = "m/s",
                 .meaning = "simulation: least car speed that (5) divides by",
                 .range = ::abs_hil::rig::between(1e-3, 0.1));
  /// A test shows the error at the default.
  ABS_HIL_OPTION(double, max_step_s, 500e-6, .unit = "s", .meaning = "simulation: largest integration step",
                 .range = ::abs_hil::rig::between(1e-6, 2e-3));
  ABS_HIL_OPTION(std::string, tyre, "magic-formula", .meaning = "simulation: friction curve",
                 .allowed = {"magic-formula", "inteco-mu"});
  ABS_HIL_OPTION(std::string, load, "constant", .meaning = "simulation: normal force",
                 .allowed = {"constant", "lever"});
  ABS_HIL_OPTION(double, mu_peak, 0.4,
                 .meaning = "simulation: peak friction coefficient of tyre magic-formula under load lever",
                 .range = ::abs_hil::rig::positive(5),
                 .on_rig = "peak force of experiment slip-sweep over the normal force");
  ABS_HIL_GROUP(IntecoMuParameters, inteco_mu, "mu_", {});
  ABS_HIL_GROUP(LeverParameters, lever, "lever_", {});
  /// See FactorProfile; empty: none.
  ABS_HIL_OPTION(std::string, friction_profile, "",
                 .meaning = "simulation: friction over time or distance (docs/plants.md)");
  ABS_HIL_OPTION(double, friction_fall_s_m, 0.0, .unit = "s/m",
                 .meaning = "simulation: share of the friction lost per m/s of sliding speed",
                 .range = rig::from_zero(0.05));
  ABS_HIL_GROUP(DriftProfiles, drift, "", {});
  ABS_HIL_GROUP(BrakeFlaws, brake_flaws, "brake_", {});
  /// The drivers of the boards have a cap of their own, 0.7 by default.
  ABS_HIL_OPTION(double, brake_duty_max, 1.0,
                 .meaning = "simulation: largest brake PWM the rig's board sends; caps gate.brake_duty_max",
                 .range = ::abs_hil::rig::positive(1), .on_rig = "driver.pci.brake_duty_max, or that of your board");
  ABS_HIL_OPTION(
      double, encoder_eccentricity_rad, 0.0, .unit = "rad",
      .meaning = "simulation: eccentricity of both encoders that the model does not know, beside each one's own",
      .range = rig::from_zero(0.1));
  ABS_HIL_GROUP(EncoderFlaws, upper_encoder_flaws, "upper_encoder_", {});
  ABS_HIL_GROUP(EncoderFlaws, lower_encoder_flaws, "lower_encoder_", {});
};

/// What limits of the rig's motion must know of this plant: its own parameters. Where a lever and the tyre's curve give
/// more force than theta_N says, theta_N is made larger. Throws std::invalid_argument for a curve without a peak.
[[nodiscard]] rig::RigParameters identity_of(const PlantOptions& options);

/// Throws std::invalid_argument with the configuration key, its value and its range if an option is out of range.
void check(const PlantOptions& options);

}  // namespace abs_hil::plant_sim
