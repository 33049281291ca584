#pragma once

#include "abs_hil/rig/option.hpp"

namespace abs_hil::control {

// The defaults are the gains of config/paper/real (sliding modes, docs/paper.md) and config/tuned (docs/comparison.md);
// tests compare them.

/// Adaptation of the equivalent control, theta_hat' = -gamma k phi s, where s is the law's substitute for sign(e_v).
template <class S = double>
struct SwitchingAdaptationOptions {
  ABS_HIL_LANE_OPTIONS(SwitchingAdaptationOptions, S);
  /// 0: theta_hat keeps the value theta0_N.
  ABS_HIL_OPTION(double, gamma, 5.0, .unit = "kg^2 m/s^3", .meaning = "gain of theta_hat' = -gamma k phi sign(e_v)",
                 .range = rig::from_zero(1e4), .search = rig::search(1, 1000));
  ABS_HIL_OPTION(double, theta0_N, 23.0, .unit = "N", .meaning = "first estimate of theta",
                 .range = rig::from_zero(500), .search = rig::search_linearly(0, 40), .start_value = true);
  ABS_HIL_OPTION(double, theta_min_N, 0.0, .unit = "N", .meaning = "least theta the estimate may take",
                 .range = rig::from_zero(500));
  ABS_HIL_OPTION(double, theta_max_N, 100.0, .unit = "N", .meaning = "largest theta the estimate may take",
                 .range = rig::positive(1000));
};

struct SlidingModeOptions {
  ABS_HIL_OPTIONS(SlidingModeOptions);
  ABS_HIL_OPTION(double, gain_m_s2, 25.2, .unit = "m/s^2", .meaning = "K of -K sign(e_v)", .range = rig::positive(200),
                 .search = rig::search(0.5, 100));
  /// With it e_v arrives exponentially, and K only has to cover what the estimate leaves over.
  ABS_HIL_OPTION(double, reaching_per_s, 0.0, .unit = "1/s", .meaning = "q of -K sign(e_v) - q e_v",
                 .range = rig::from_zero(1e4));
  ABS_HIL_GROUP(SwitchingAdaptationOptions<>, adaptation, "", {.gamma = 55.5});
};

struct SmoothSlidingModeOptions {
  ABS_HIL_OPTIONS(SmoothSlidingModeOptions);
  ABS_HIL_OPTION(double, gain_m_s2, 84.7, .unit = "m/s^2", .meaning = "K of -K sat(e_v/width)",
                 .range = rig::positive(200), .search = rig::search(0.5, 100));
  ABS_HIL_OPTION(double, boundary_m_s, 2.93, .unit = "m/s", .meaning = "width of the boundary layer in e_v",
                 .range = rig::between(1e-3, 10), .search = rig::search(0.01, 5));
  ABS_HIL_GROUP(SwitchingAdaptationOptions<>, adaptation, "", {.gamma = 156.0});
};

struct SuperTwistingOptions {
  ABS_HIL_OPTIONS(SuperTwistingOptions);
  ABS_HIL_OPTION(double, k1, 30.3, .unit = "m^0.5/s^1.5", .meaning = "gain of sqrt|e_v|", .range = rig::positive(200),
                 .search = rig::search(0.5, 100));
  ABS_HIL_OPTION(double, k2, 1.69, .unit = "m/s^3", .meaning = "gain of the integral of sign(e_v)",
                 .range = rig::positive(5000), .search = rig::search(1, 2000));
  ABS_HIL_GROUP(SwitchingAdaptationOptions<>, adaptation, "", {.gamma = 23.2});
};

struct RelayOptions {
  ABS_HIL_OPTIONS(RelayOptions);
  ABS_HIL_OPTION(double, threshold, 0.0447, .meaning = "slip that releases the brake; 0: control.slip_ref",
                 .range = rig::from_zero(0.99), .search = rig::search(0.01, 0.6));
};

struct PiOptions {
  ABS_HIL_OPTIONS(PiOptions);
  ABS_HIL_OPTION(double, kp_per_s, 39.3, .unit = "1/s", .meaning = "proportional gain on e_v",
                 .range = rig::positive(1000), .search = rig::search(2, 300));
  ABS_HIL_OPTION(double, ki_per_s2, 71.6, .unit = "1/s^2", .meaning = "integral gain on e_v",
                 .range = rig::from_zero(1e4), .search = rig::search(0.1, 2000));
  ABS_HIL_OPTION(double, feed_forward, 0.0311, .meaning = "share of the measured tyre force fed forward",
                 .range = rig::between(0, 1), .search = rig::search_linearly(0, 1));
};

/// A sum of slip and wheel deceleration that a PI controller holds.
template <class S = double>
struct MixedSlipDecelerationOptions {
  ABS_HIL_LANE_OPTIONS(MixedSlipDecelerationOptions, S);
  ABS_HIL_OPTION(double, weight, 0.0137, .meaning = "weight of the wheel's deceleration in g beside the slip",
                 .range = rig::from_zero(10));
  ABS_HIL_OPTION(double, target, 0.1, .meaning = "wanted sum of slip and weighted deceleration",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(double, kp_Nm, 78.0, .unit = "N m", .meaning = "proportional gain on that sum",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, ki_Nm_s, 237.0, .unit = "N m/s", .meaning = "integral gain on that sum",
                 .range = rig::from_zero(1e6));
};

/// Accelerations are those of the wheel's circumference, r1 omega1'. FivePhaseLaw names the phases.
template <class S = double>
struct FivePhaseOptions {
  ABS_HIL_LANE_OPTIONS(FivePhaseOptions, S);
  /// Apply or re-apply -> hold.
  ABS_HIL_OPTION(double, hold_below_m_s2, -5.15, .unit = "m/s^2",
                 .meaning = "wheel acceleration below which the torque is held", .range = rig::negative(-500),
                 .search = rig::search_linearly(-150, -5));
  /// Hold -> release; at most hold_below_m_s2.
  ABS_HIL_OPTION(double, release_below_m_s2, -23.3, .unit = "m/s^2", .meaning = "... below which it is released",
                 .range = rig::negative(-500), .search = rig::search_linearly(-200, -5));
  /// Release -> recover.
  ABS_HIL_OPTION(double, recover_above_m_s2, -16.2, .unit = "m/s^2", .meaning = "... above which releasing ends",
                 .range = rig::between(-500, 500), .search = rig::search_linearly(-50, 50));
  /// Recover -> re-apply, once the acceleration has been above it.
  ABS_HIL_OPTION(double, reapply_below_m_s2, 50.9, .unit = "m/s^2",
                 .meaning = "... below which, after its peak, it is re-applied", .range = rig::between(-500, 500),
                 .search = rig::search_linearly(-20, 60));
  ABS_HIL_OPTION(double, hold_limit_s, 0.122, .unit = "s", .meaning = "longest hold before the torque is re-applied",
                 .range = rig::positive(5), .search = rig::search(0.005, 0.3));
  /// Release at zero torque -> recover, and recover -> re-apply when nothing happens.
  ABS_HIL_OPTION(double, recover_limit_s, 0.347, .unit = "s", .meaning = "longest wait for the wheel to come back",
                 .range = rig::positive(5), .search = rig::search(0.01, 0.5));
  ABS_HIL_OPTION(double, apply_Nm_s, 118.0, .unit = "N m/s", .meaning = "torque ramp of the first application",
                 .range = rig::positive(1e4), .search = rig::search(10, 500));
  ABS_HIL_OPTION(double, release_Nm_s, 479.0, .unit = "N m/s", .meaning = "torque ramp down",
                 .range = rig::positive(1e4), .search = rig::search(10, 1000));
  ABS_HIL_OPTION(double, reapply_Nm_s, 22.4, .unit = "N m/s", .meaning = "torque ramp of the re-application",
                 .range = rig::positive(1e4), .search = rig::search(1, 300));
};

}  // namespace abs_hil::control
