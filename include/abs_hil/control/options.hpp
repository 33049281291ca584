#pragma once

#include <string>

#include "abs_hil/control/baseline_options.hpp"

namespace abs_hil::control {

/// Gains of the slip velocity error's dynamics e_v'' + ks1 e_v' + ks0 e_v = 0 and of the adaptation (17)-(18); Table 1.
/// Q and ka1 are not given in the paper: Q = I and ka1 = 1 by default.
struct AdaptiveOptions {
  double gamma{21.0};  ///< adaptation gain, > 0
  double ks0{19.0};    ///< integral gain, 1/s^2, > 0
  double ks1{32.0};    ///< proportional gain, 1/s, > 0
  double ka1{1.0};     ///< weight of the observer's innovation in the adaptation, > 0
  double zeta0{0.0};   ///< zeta(0), N: the first estimate of theta
  double q11{1.0};     ///< Q of PA + A'P = -2Q, symmetric and positive definite
  double q12{0.0};
  double q22{1.0};
  double theta_min_N{0.0};  ///< the estimate is projected onto [theta_min_N, theta_max_N]
  double theta_max_N{100.0};
};

/// How fast the unknowns of WheelForceObserver may change: intensities of the white noise on their rates.
struct ForceObserverOptions {
  double force_rate_N2_s{100.0};  ///< of the tyre force, N^2/s, > 0
  double brake_rate_Nm2_s{0.3};   ///< of the brake torque that the actuator's model misses, (N m)^2/s, > 0
};

/// Adaptive controller that steps back through the brake's lag: a set of gains of its own, and those of the third step.
struct AdaptiveActuatorOptions {
  AdaptiveOptions law{.ka1 = 3.5};
  double lag_gain_per_s{100.0};  ///< decay of the torque error that the lag leaves, > 0
  double lag_weight_s2{1e-4};    ///< weight of that error in V, > 0
  ForceObserverOptions observer{};
};

/// SlipPeakEstimator: what is believed of the tyre at first, and how fast it may change.
struct SlipPeakOptions {
  double peak_slip0{0.08};        ///< first guess of the peak's slip, within the controller's bounds of the slip
  double peak_force0_N{20.0};     ///< first guess of the peak's force, N, > 0
  double force_drift_per_s{0.3};  ///< variance that the logarithm of the peak's force gains per second, > 0
  double slip_drift_per_s{0.05};  ///< the same of its slip, > 0
  double shape_drift_per_s{0.1};  ///< the same of the curve's shape, > 0
  double force_noise_N2_s{0.01};  ///< intensity of the noise of the force, N^2 s, > 0
  double jump_level{0.15};        ///< unexplained change, as a part of the peak force, that counts as a jump, > 0
  double jump_hold_s{0.04};       ///< after a jump only the level is learnt for this long, >= 0
};

/// Slip controller that seeks the peak of the tyre force.
struct AdaptivePeakOptions {
  double ks0{100.0};             ///< integral gain of the slip loop, 1/s^2, > 0
  double ks1{70.0};              ///< proportional gain of the slip loop, 1/s, > 0
  double lag_gain_per_s{130.0};  ///< decay of the torque error that the brake's lag leaves, > 0
  double slip_min{0.01};         ///< the reference stays within [slip_min, slip_max], in (0, 1)
  double slip_max{0.3};
  double slip_start{0.02};      ///< reference at the start of braking, in (0, 1)
  double slip_rate_per_s{1.0};  ///< fastest change of the reference, > 0
  double search_part{0.1};      ///< amplitude of the search, as a part of the reference, >= 0
  double search_min{0.005};     ///< its least amplitude, as a slip, >= 0
  double search_rad_s{60.0};    ///< its frequency, > 0
  SlipPeakOptions peak{};
  ForceObserverOptions observer{.force_rate_N2_s = 200.0, .brake_rate_Nm2_s = 3.0};
};

/// Nominal controller (16). It shares ks0 and ks1 with the adaptive one.
struct NominalOptions {
  double theta0_N{0.0};  ///< theta it believes in; 0: the plant's own
};

/// Third-order tracking observer of the wheel speeds.
struct ObserverOptions {
  double bandwidth_rad_s{150.0};   ///< triple pole, > 0
  double standstill_time_s{0.05};  ///< a wheel whose count has not changed for this long stands still
};

/// Everything below `control.` in the configuration.
struct ControlOptions {
  std::string controller{"adaptive"};
  double rate_Hz{1000.0};  ///< control cycles per second, 100 ... 10000
  double slip_ref{0.15};   ///< in (0, 1)
  double v_min_m_s{0.3};   ///< below this car speed slip control hands over to the sequence, > 0
  AdaptiveOptions adaptive{};
  AdaptiveActuatorOptions adaptive_actuator{};
  AdaptivePeakOptions adaptive_peak{};
  NominalOptions nominal{};
  SlidingModeOptions sliding_mode{};
  SmoothSlidingModeOptions sliding_mode_smooth{};
  SuperTwistingOptions super_twisting{};
  RelayOptions relay{};
  PiOptions pi{};
  FivePhaseOptions five_phase{};
  ObserverOptions observer{};
};

}  // namespace abs_hil::control
