#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/control/baseline_options.hpp"
#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/option_box.hpp"

namespace abs_hil::control {

/// Gains of the slip velocity error's dynamics e_v'' + ks1 e_v' + ks0 e_v = 0 and of the adaptation (17)-(18); Table 1.
/// The paper does not give Q and ka1. Their defaults are Q = I and ka1 = 1.
struct AdaptiveOptions {
  ABS_HIL_OPTIONS(AdaptiveOptions);
  ABS_HIL_OPTION(double, gamma, 21.0, .unit = "kg^2/s^2", .meaning = "adaptation gain of (17)",
                 .range = rig::between(1e-6, 1e4), .search = rig::search(1, 1000));
  ABS_HIL_OPTION(double, ks0, 19.0, .unit = "1/s^2", .meaning = "integral gain of (16), (18)",
                 .range = rig::between(1e-6, 1e6), .search = rig::search(1, 500));
  ABS_HIL_OPTION(double, ks1, 32.0, .unit = "1/s", .meaning = "proportional gain of (16), (18)",
                 .range = rig::between(1e-6, 1e4), .search = rig::search(4, 200));
  ABS_HIL_OPTION(double, ka1, 1.0, .unit = "s/kg^2", .meaning = "innovation's weight in (18)",
                 .range = rig::between(1e-6, 1e3), .search = rig::search(0.05, 20));
  /// The first estimate of theta.
  ABS_HIL_OPTION(double, zeta0, 0.0, .unit = "N", .meaning = "zeta(0) of (17)", .range = rig::between(-500, 500),
                 .search = rig::search_linearly(0, 40), .start_value = true);
  // The lower ends keep gamma ka1 and the solution of the Lyapunov equation away from what a double cannot hold.
  /// Q = diag(q11, q22). An element beside the diagonal would act on no law: B'P does not contain it.
  ABS_HIL_OPTION(double, q11, 1.0, .unit = "1/s^3", .meaning = "Q of PA + A'P = -2Q", .range = rig::positive(1e6));
  ABS_HIL_OPTION(double, q22, 1.0, .unit = "1/s", .meaning = "Q of PA + A'P = -2Q", .range = rig::positive(1e6));
  /// The estimate is projected onto [theta_min_N, theta_max_N].
  ABS_HIL_OPTION(double, theta_min_N, 0.0, .unit = "N", .meaning = "least theta the estimate may take",
                 .range = rig::from_zero(500));
  ABS_HIL_OPTION(double, theta_max_N, 100.0, .unit = "N", .meaning = "largest theta the estimate may take",
                 .range = rig::positive(1000));
};

/// How fast the unknowns of WheelForceObserver may change: intensities of the white noise on their rates.
template <class S = double>
struct ForceObserverOptions {
  ABS_HIL_LANE_OPTIONS(ForceObserverOptions, S);
  ABS_HIL_OPTION(double, force_rate_N2_s, 100.0, .unit = "N^2/s",
                 .meaning = "force observer: how fast the tyre force may change", .range = rig::positive(1e9));
  ABS_HIL_OPTION(double, brake_rate_Nm2_s, 0.3, .unit = "(N m)^2/s",
                 .meaning = "force observer: how fast the brake model's error may change", .range = rig::positive(1e6));
};

/// Adaptive controller with the brake's lag as a third backstepping step: its own set of gains, and those of this step.
struct AdaptiveActuatorOptions {
  ABS_HIL_OPTIONS(AdaptiveActuatorOptions);
  ABS_HIL_GROUP(AdaptiveOptions, law, rig::not_searched(""), {.ka1 = 3.5});
  ABS_HIL_OPTION(double, lag_gain_per_s, 100.0, .unit = "1/s",
                 .meaning = "decay of the torque error that the brake's lag leaves", .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, lag_weight_s2, 1e-4, .unit = "s^2", .meaning = "weight of that error in the Lyapunov function",
                 .range = rig::positive(1e3));
  ABS_HIL_GROUP(ForceObserverOptions<>, observer, "", {});
};

/// Sliding mode with a boundary layer, stepped back through the brake's lag.
struct SlidingModeActuatorOptions {
  ABS_HIL_OPTIONS(SlidingModeActuatorOptions);
  ABS_HIL_OPTION(double, gain_m_s2, 50.0, .unit = "m/s^2", .meaning = "K of -K sat(e_v/width)",
                 .range = rig::positive(200), .search = rig::search(0.5, 100));
  ABS_HIL_OPTION(double, boundary_m_s, 0.592, .unit = "m/s", .meaning = "width of the boundary layer in e_v",
                 .range = rig::between(1e-3, 10), .search = rig::search(0.01, 5));
  ABS_HIL_OPTION(double, lag_gain_per_s, 72.6, .unit = "1/s",
                 .meaning = "decay of the torque error that the brake's lag leaves", .range = rig::positive(1e4),
                 .search = rig::search(10, 500));
  ABS_HIL_GROUP(SwitchingAdaptationOptions<>, adaptation, "", {.gamma = 261.0});
  ABS_HIL_GROUP(ForceObserverOptions<>, observer, "", {});
};

/// Slip controller that raises the slip while the tyre force still grows with it.
template <class S = double>
struct BrakingStiffnessOptions {
  ABS_HIL_LANE_OPTIONS(BrakingStiffnessOptions, S);
  ABS_HIL_OPTION(double, memory_s, 0.021, .unit = "s", .meaning = "memory of the slope of force over slip",
                 .range = rig::between(0.002, 10));
  ABS_HIL_OPTION(double, slip_noise, 0.002, .meaning = "spread of the slip that tells nothing of the slope",
                 .range = rig::between(1e-6, 0.1));
  ABS_HIL_OPTION(double, target, 0.0296, .meaning = "relative growth of force per relative growth of slip to stay at",
                 .range = rig::between(-1, 1));
  ABS_HIL_OPTION(double, rate_per_s, 3.64, .unit = "1/s", .meaning = "gain of the wanted slip's logarithm on it",
                 .range = rig::positive(1000));
  ABS_HIL_OPTION(double, slip_min, 0.01, .meaning = "least slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_max, 0.35, .meaning = "largest slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_start, 0.0507, .meaning = "slip reference at the start of braking",
                 .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, search_part, 0.169, .meaning = "amplitude of the search as a part of the reference",
                 .range = rig::from_zero_below(1));
  ABS_HIL_OPTION(double, search_rad_s, 30.8, .unit = "rad/s", .meaning = "frequency of the search",
                 .range = rig::positive(1000));
  ABS_HIL_OPTION(double, slip_gain_per_s, 144.0, .unit = "1/s", .meaning = "decay of the slip velocity error",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, lag_gain_per_s, 46.2, .unit = "1/s",
                 .meaning = "decay of the torque error that the brake's lag leaves", .range = rig::positive(1e4));
  ABS_HIL_GROUP(ForceObserverOptions<S>, observer, "", {.force_rate_N2_s = 20.1, .brake_rate_Nm2_s = 0.507});
};

/// SlipPeakEstimator: initial values of the tyre curve, and how fast they may change.
template <class S = double>
struct SlipPeakOptions {
  ABS_HIL_LANE_OPTIONS(SlipPeakOptions, S);
  /// Within the controller's bounds of the slip.
  ABS_HIL_OPTION(double, peak_slip0, 0.08, .meaning = "first guess of the peak's slip",
                 .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, peak_force0_N, 20.0, .unit = "N", .meaning = "first guess of the peak's force",
                 .range = rig::positive(500));
  ABS_HIL_OPTION(double, force_drift_per_s, 0.3, .unit = "1/s", .meaning = "variance of ln force gained per second",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, slip_drift_per_s, 0.05, .unit = "1/s", .meaning = "variance of ln slip gained per second",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, shape_drift_per_s, 0.1, .unit = "1/s",
                 .meaning = "variance of the curve's shape gained per second", .range = rig::positive(100));
  ABS_HIL_OPTION(double, force_noise_N2_s, 0.01, .unit = "N^2 s", .meaning = "intensity of the force estimate's noise",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, jump_level, 0.15, .meaning = "unexplained part of the peak force that is a friction jump",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(double, jump_hold_s, 0.04, .unit = "s",
                 .meaning = "time after a jump in which only the level is learnt", .range = rig::from_zero(1));
};

/// Slip controller that finds the peak of the tyre force.
template <class S = double>
struct AdaptivePeakOptions {
  ABS_HIL_LANE_OPTIONS(AdaptivePeakOptions, S);
  ABS_HIL_OPTION(double, ks0, 100.0, .unit = "1/s^2", .meaning = "integral gain of the slip loop",
                 .range = rig::positive(1e6));
  ABS_HIL_OPTION(double, ks1, 70.0, .unit = "1/s", .meaning = "proportional gain of the slip loop",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, lag_gain_per_s, 130.0, .unit = "1/s",
                 .meaning = "decay of the torque error that the brake's lag leaves", .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, slip_min, 0.01, .meaning = "least slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_max, 0.3, .meaning = "largest slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_start, 0.02, .meaning = "slip reference at the start of braking",
                 .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_rate_per_s, 1.0, .unit = "1/s", .meaning = "fastest change of the slip reference",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, search_part, 0.1, .meaning = "amplitude of the search as a part of the reference",
                 .range = rig::from_zero_below(1));
  ABS_HIL_OPTION(double, search_min, 0.005, .meaning = "least amplitude of the search, as a slip",
                 .range = rig::between(0, 0.1));
  ABS_HIL_OPTION(double, search_rad_s, 60.0, .unit = "rad/s", .meaning = "frequency of the search",
                 .range = rig::positive(1000));
  ABS_HIL_GROUP(SlipPeakOptions<S>, peak, "", {});
  ABS_HIL_GROUP(ForceObserverOptions<S>, observer, "", {.force_rate_N2_s = 200.0, .brake_rate_Nm2_s = 3.0});
};

/// FrictionBank: what is known of the tyre before braking, and how well its inputs are trusted.
template <class S = double>
struct FrictionBankOptions {
  ABS_HIL_LANE_OPTIONS(FrictionBankOptions, S);
  ABS_HIL_OPTION(double, force_bandwidth_rad_s, 165.0, .unit = "rad/s",
                 .meaning = "bandwidth of the force that the curve is learnt from", .range = rig::between(10, 2000));
  ABS_HIL_OPTION(double, force_noise_N2_s, 0.00356, .unit = "N^2 s",
                 .meaning = "intensity of that force's noise, with 4096 counts a turn", .range = rig::positive(100));
  ABS_HIL_OPTION(double, force_error, 0.0087, .meaning = "part of the force that the curve need not explain",
                 .range = rig::positive(1));
  ABS_HIL_OPTION(double, timing_error_s, 0.0008, .unit = "s", .meaning = "delay between slip and force left unknown",
                 .range = rig::from_zero(0.1));
  ABS_HIL_OPTION(double, slip_noise_m_s, 0.00154, .unit = "m/s", .meaning = "error of the difference of both speeds",
                 .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, start_s, 0.013, .unit = "s", .meaning = "time at the start in which nothing is learnt",
                 .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, slip0, 0.0545, .meaning = "median of the peak's slip before braking",
                 .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_spread, 1.28, .meaning = "standard deviation of the logarithm of the peak's slip",
                 .range = rig::between(0.05, 5));
  ABS_HIL_OPTION(double, last_peak_slip, 0.0,
                 .meaning = "slip of the peak that the last braking on this rig has left; 0: there was none",
                 .range = rig::from_zero_below(1));
  ABS_HIL_OPTION(double, last_peak_spread, 0.4, .meaning = "standard deviation of its logarithm",
                 .range = rig::between(0.05, 5));
  ABS_HIL_OPTION(double, last_peak_part, 0.7,
                 .meaning = "trust in it: part of the first weights that it decides; slip0 decides the others",
                 .range = rig::from_zero_below(1));
  ABS_HIL_OPTION(double, level0_N, 12.5, .unit = "N", .meaning = "first guess of the peak's force",
                 .range = rig::positive(500));
  ABS_HIL_OPTION(double, level_spread_N, 22.0, .unit = "N", .meaning = "standard deviation of this guess",
                 .range = rig::positive(500));
  ABS_HIL_OPTION(
      double, zero_error_m_s, 0.009, .unit = "m/s",
      .meaning = "error of the difference of both speeds that is read as braking begins, with 4096 counts a turn",
      .range = rig::between(1e-6, 1));
  ABS_HIL_OPTION(double, zero_error_per_N, 0.002, .unit = "1/N",
                 .meaning = "error of the slip at no force for each newton of tyre force that acts then",
                 .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, past_peak_cost, 1.0,
                 .meaning = "what a peak that is passed costs more, times the runaway of the slip behind it",
                 .range = rig::from_zero(1e4));
  ABS_HIL_OPTION(double, level_drift_per_s, 0.00625, .unit = "1/s",
                 .meaning = "variance gained per second by the logarithm of the peak's force",
                 .range = rig::from_zero(100));
  ABS_HIL_OPTION(double, level_drift_unexplained_per_s, 15.0, .unit = "1/s",
                 .meaning = "what the square of the unexplained part of the peak's force adds to that",
                 .range = rig::from_zero(1e4));
  ABS_HIL_OPTION(double, zero_drift_per_s, 0.000125, .unit = "1/s",
                 .meaning = "variance gained per second by the slip read at no force", .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, share_per_s, 0.0147, .unit = "1/s",
                 .meaning = "part of the weights that returns to the curves known before braking, per second",
                 .range = rig::between(1e-9, 100));
  ABS_HIL_OPTION(double, jump_share, 0.143, .meaning = "unexplained part of the peak's force that is a friction jump",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(double, jump_least_N, 2.2, .unit = "N", .meaning = "least unexplained force that is a friction jump",
                 .range = rig::positive(500));
  ABS_HIL_OPTION(
      double, jump_slip_m_s, 0.02, .unit = "m/s",
      .meaning = "error of the difference of both speeds whose force is no friction jump, with 4096 counts a turn",
      .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, jump_confirm_s, 0.0028, .unit = "s", .meaning = "time that it must last",
                 .range = rig::from_zero(1));
  ABS_HIL_OPTION(double, jump_hold_s, 0.0308, .unit = "s",
                 .meaning = "time after a jump in which only the level is learnt", .range = rig::positive(1));
  ABS_HIL_OPTION(double, jump_time_constant_s, 0.00244, .unit = "s",
                 .meaning = "time constant with which the level is learnt then", .range = rig::positive(1));
  ABS_HIL_OPTION(double, jump_spread, 0.108, .meaning = "relative standard deviation of the level after that",
                 .range = rig::from_zero(10));
  ABS_HIL_OPTION(double, jump_after_s, 0.1, .unit = "s",
                 .meaning = "time at the start in which no friction jump is looked for", .range = rig::from_zero(10));
};

/// Slip controller that finds the peak of the tyre force, and spares the brake.
template <class S = double>
struct AdaptiveOptimalOptions {
  ABS_HIL_LANE_OPTIONS(AdaptiveOptimalOptions, S);
  ABS_HIL_OPTION(double, slip_gain_per_s, 58.0, .unit = "1/s", .meaning = "decay of a large slip velocity error",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, slip_gain_near_per_s, 13.9, .unit = "1/s", .meaning = "decay of a small one",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, slip_gain_runaway, 6.96,
                 .meaning = "what is added to that, over the rate at which the slip runs away past the peak",
                 .range = rig::from_zero(1e4));
  ABS_HIL_OPTION(double, slip_near_m_s, 0.07, .unit = "m/s", .meaning = "error at which the gain is half way between",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(double, torque_gain_per_s, 165.0, .unit = "1/s", .meaning = "decay of a large torque error",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, torque_gain_near_per_s, 21.8, .unit = "1/s", .meaning = "decay of a small one",
                 .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, torque_near_Nm, 0.54, .unit = "N m", .meaning = "error at which the gain is half way between",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, play_Nm, 0.278, .unit = "N m", .meaning = "change of the torque below which the brake rests",
                 .range = rig::from_zero(10));
  ABS_HIL_OPTION(double, authority, 0.938, .meaning = "part of the fastest approach from too little slip that is used",
                 .range = rig::between(0.01, 1));
  ABS_HIL_OPTION(double, authority_past_peak, 1.0, .meaning = "the same where the force falls as the slip grows",
                 .range = rig::between(0.01, 1));
  ABS_HIL_OPTION(double, bold_slip, 0.2, .meaning = "slip that an unknown peak may cost at the start",
                 .range = rig::positive(100));
  ABS_HIL_OPTION(double, model_error_per_s, 50.0, .unit = "1/s",
                 .meaning = "how fast the error of the holding torque is learnt", .range = rig::positive(1e4));
  ABS_HIL_OPTION(double, peak_factor, 1.17, .meaning = "slip reference over the estimated slip of the peak",
                 .range = rig::between(0.5, 2));
  ABS_HIL_OPTION(
      double, runaway, 0.7,
      .meaning = "runaway of the slip past the peak, per time constant of the brake, that undoes this factor",
      .range = rig::positive(1e6));
  ABS_HIL_OPTION(double, slip_min, 0.015, .meaning = "least slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_max, 0.35, .meaning = "largest slip reference", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_start, 0.0375, .meaning = "slip reference at the start of braking",
                 .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, slip_rate_per_s, 15.0, .unit = "1/s",
                 .meaning = "fastest rise of the logarithm of the slip reference", .range = rig::positive(1000));
  ABS_HIL_OPTION(double, search_part, 0.08, .meaning = "amplitude of the search as a part of the reference",
                 .range = rig::from_zero_below(1));
  ABS_HIL_OPTION(double, search_rad_s, 24.0, .unit = "rad/s", .meaning = "frequency of the search",
                 .range = rig::positive(1000));
  ABS_HIL_GROUP(FrictionBankOptions<S>, bank, "", {});
  ABS_HIL_GROUP(ForceObserverOptions<S>, observer, "", {.force_rate_N2_s = 360.0, .brake_rate_Nm2_s = 4.0});
};

/// Nominal controller (16). It shares ks0 and ks1 with the adaptive one.
struct NominalOptions {
  ABS_HIL_OPTIONS(NominalOptions);
  ABS_HIL_OPTION(double, theta0_N, 0.0, .unit = "N", .meaning = "theta that (16) believes in; 0: the model's",
                 .range = rig::from_zero(500));
};

/// Third-order tracking observer of the wheel speeds.
struct ObserverOptions {
  ABS_HIL_OPTIONS(ObserverOptions);
  ABS_HIL_OPTION(double, bandwidth_rad_s, 150.0, .unit = "rad/s", .meaning = "speed observer's triple pole",
                 .range = rig::between(5, 2000));
  ABS_HIL_OPTION(double, standstill_time_s, 0.05, .unit = "s",
                 .meaning = "time without a count after which a wheel stands", .range = rig::between(0.005, 1));
  ABS_HIL_OPTION(
      double, learn_eccentricity_s, 0.4, .unit = "s",
      .meaning = "time without brake in which the encoders' eccentricity is fitted anew; 0: the model's holds",
      .range = rig::from_zero(10));
  ABS_HIL_OPTION(double, unlearnt_eccentricity_rad, 0.003, .unit = "rad",
                 .meaning = "eccentricity that adaptive-optimal allows for until it is learnt",
                 .range = rig::from_zero(0.1));
};

/// Name number `index` of the table of controllers; empty beyond the last.
[[nodiscard]] std::string_view controller_name(std::size_t index) noexcept;

/// Controllers that come from a file (docs/interchange.md).
struct ForeignOptions {
  ABS_HIL_OPTIONS(ForeignOptions);
  ABS_HIL_OPTION(std::string, mapping, "",
                 .meaning = "TOML file with the names that an FMU's variables have, and its parameters");
};

/// The options of those controllers that bring a struct of their own (`controller_entry`), each below its controller's
/// name. So a new controller has keys without a change here, also outside this library.
class OwnOptions {
 public:
  /// Those of the controllers that are registered now.
  OwnOptions();
  void visit_options(const std::string& prefix, const rig::OptionVisitor& visit);
  /// The options of this type; their defaults if no registered controller has them.
  template <class Options>
  [[nodiscard]] Options get() const {
    for (const auto& [section, options] : options_) {
      if (const Options* found = options.template as<Options>()) return *found;
    }
    return Options{};
  }

 private:
  std::vector<std::pair<std::string, rig::OptionBox>> options_{};
};

/// The keys `control.` of the configuration.
struct ControlOptions {
  ABS_HIL_OPTIONS(ControlOptions);
  ABS_HIL_OPTION(std::string, controller, "adaptive", .meaning = "slip controller", .allowed = controller_name,
                 .files = {".so", ".fmu", ".agent", rig::FileEndings::python_class});
  ABS_HIL_OPTION(double, rate_Hz, 1000.0, .unit = "Hz", .meaning = "control cycles per second",
                 .range = rig::between(100, 10'000));
  ABS_HIL_OPTION(double, slip_ref, 0.15, .meaning = "wanted slip", .range = rig::open_between(0, 1));
  ABS_HIL_OPTION(double, v_min_m_s, 0.3, .unit = "m/s", .meaning = "car speed below which slip control ends",
                 .range = rig::between(0.05, 5));
  ABS_HIL_GROUP(AdaptiveOptions, adaptive, "adaptive.", {});
  ABS_HIL_GROUP(NominalOptions, nominal, "nominal.", {});
  ABS_HIL_GROUP(ObserverOptions, observer, "observer.", {});
  ABS_HIL_GROUP(SlidingModeOptions, sliding_mode, "sliding_mode.", {});
  ABS_HIL_GROUP(SmoothSlidingModeOptions, sliding_mode_smooth, "sliding_mode_smooth.", {});
  ABS_HIL_GROUP(SuperTwistingOptions, super_twisting, "super_twisting.", {});
  ABS_HIL_GROUP(RelayOptions, relay, "relay.", {});
  ABS_HIL_GROUP(PiOptions, pi, "pi.", {});
  ABS_HIL_GROUP(FivePhaseOptions<>, five_phase, "five_phase.", {});
  ABS_HIL_GROUP(AdaptiveActuatorOptions, adaptive_actuator, "adaptive_actuator.", {});
  ABS_HIL_GROUP(AdaptivePeakOptions<>, adaptive_peak, "adaptive_peak.", {});
  ABS_HIL_GROUP(AdaptiveOptimalOptions<>, adaptive_optimal, "adaptive_optimal.", {});
  ABS_HIL_GROUP(MixedSlipDecelerationOptions<>, mixed_slip_deceleration, "mixed_slip_deceleration.", {});
  ABS_HIL_GROUP(BrakingStiffnessOptions<>, braking_stiffness, "braking_stiffness.", {});
  ABS_HIL_GROUP(SlidingModeActuatorOptions, sliding_mode_actuator, "sliding_mode_actuator.", {});
  ABS_HIL_GROUP(ForeignOptions, foreign, "foreign.", {});
  ABS_HIL_GROUP(OwnOptions, own, "", {});
};

}  // namespace abs_hil::control
