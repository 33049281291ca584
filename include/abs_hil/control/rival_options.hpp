#pragma once

namespace abs_hil::control {

// The defaults are first gains, found by hand and by a coarse search on paper-table1 and paper-timing together, with
// the real actuator and encoders.

/// Adaptation of the equivalent control, theta_hat' = -gamma k phi s, where s is what stands for sign(e_v).
struct SwitchingAdaptationOptions {
  double gamma{5.0};        ///< gain, >= 0; 0: theta_hat stays at theta0_N
  double theta0_N{18.0};    ///< first estimate of theta
  double theta_min_N{0.0};  ///< the estimate is projected onto [theta_min_N, theta_max_N]
  double theta_max_N{100.0};
};

struct SlidingModeOptions {
  double gain_m_s2{50.0};  ///< K, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 1.0};
};

struct SmoothSlidingModeOptions {
  double gain_m_s2{59.0};    ///< K, > 0
  double boundary_m_s{2.3};  ///< width of the boundary layer in e_v, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 46.0};
};

struct SuperTwistingOptions {
  double k1{46.0};  ///< gain of sqrt|e_v|, m^0.5/s^1.5, > 0
  double k2{25.0};  ///< gain of the integral of sign(e_v), m/s^3, > 0
  SwitchingAdaptationOptions adaptation{.gamma = 8.6, .theta0_N = 12.0};
};

struct RelayOptions {
  double threshold{0.0};  ///< slip above which the brake is released; 0: the wanted slip
};

struct PiOptions {
  double kp_per_s{32.0};     ///< proportional gain on e_v, > 0
  double ki_per_s2{56.0};    ///< integral gain, >= 0
  double feed_forward{0.2};  ///< share of the measured tyre force's torque that is fed forward, 0 ... 1
};

/// Accelerations are those of the wheel's circumference, r1 omega1'. FivePhaseController names the phases.
struct FivePhaseOptions {
  double hold_below_m_s2{-6.2};      ///< apply or re-apply -> hold, < 0
  double release_below_m_s2{-20.0};  ///< hold -> release, <= hold_below_m_s2
  double recover_above_m_s2{8.0};    ///< release -> recover
  double reapply_below_m_s2{10.5};   ///< recover -> re-apply, once the acceleration has been above it
  double hold_limit_s{0.2};          ///< hold -> re-apply when nothing happens, > 0
  double recover_limit_s{0.1};       ///< release at zero torque -> recover, recover -> re-apply when nothing happens
  double apply_Nm_s{88.0};           ///< torque ramps, > 0
  double release_Nm_s{240.0};
  double reapply_Nm_s{19.0};
};

}  // namespace abs_hil::control
