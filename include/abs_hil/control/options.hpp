#pragma once

#include <string>

#include "abs_hil/control/rival_options.hpp"

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
