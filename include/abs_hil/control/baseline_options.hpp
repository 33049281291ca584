#pragma once

namespace abs_hil::control {

// The defaults are the gains that abs_tune recorded in config/tuned (docs/comparison.md); a test compares them.

/// Adaptation of the equivalent control, theta_hat' = -gamma k phi s, where s is what stands for sign(e_v).
struct SwitchingAdaptationOptions {
  double gamma{5.0};        ///< gain, >= 0; 0: theta_hat stays at theta0_N
  double theta0_N{18.0};    ///< first estimate of theta
  double theta_min_N{0.0};  ///< the estimate is projected onto [theta_min_N, theta_max_N]
  double theta_max_N{100.0};
};

struct SlidingModeOptions {
  double gain_m_s2{73.8};  ///< K, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 1.25, .theta0_N = 0.497};
};

struct SmoothSlidingModeOptions {
  double gain_m_s2{95.3};     ///< K, > 0
  double boundary_m_s{2.29};  ///< width of the boundary layer in e_v, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 69.1, .theta0_N = 0.837};
};

struct SuperTwistingOptions {
  double k1{37.8};  ///< gain of sqrt|e_v|, m^0.5/s^1.5, > 0
  double k2{3.47};  ///< gain of the integral of sign(e_v), m/s^3, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 2.02, .theta0_N = 29.3};
};

struct RelayOptions {
  double threshold{0.0447};  ///< slip above which the brake is released; 0: the wanted slip
};

struct PiOptions {
  double kp_per_s{39.3};        ///< proportional gain on e_v, > 0
  double ki_per_s2{71.6};       ///< integral gain, >= 0
  double feed_forward{0.0311};  ///< share of the measured tyre force's torque that is fed forward, 0 ... 1
};

/// Accelerations are those of the wheel's circumference, r1 omega1'. FivePhaseController names the phases.
struct FivePhaseOptions {
  double hold_below_m_s2{-5.15};     ///< apply or re-apply -> hold, < 0
  double release_below_m_s2{-23.3};  ///< hold -> release, <= hold_below_m_s2
  double recover_above_m_s2{-16.2};  ///< release -> recover
  double reapply_below_m_s2{50.9};   ///< recover -> re-apply, once the acceleration has been above it
  double hold_limit_s{0.122};        ///< hold -> re-apply when nothing happens, > 0
  double recover_limit_s{0.347};     ///< release at zero torque -> recover, recover -> re-apply when nothing happens
  double apply_Nm_s{118.0};          ///< torque ramps, > 0
  double release_Nm_s{479.0};
  double reapply_Nm_s{22.4};
};

}  // namespace abs_hil::control
