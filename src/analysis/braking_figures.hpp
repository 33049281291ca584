#pragma once

// Figures of merit of a braking run: the table that summary, comparison, study, report and benchmark are made from, and
// the recursion that computes them cycle by cycle.
//
// With t from the start of braking, tau the torque reference, judged cycles those of phase brake with v_x > 3 m/s:
//   rms          sqrt(mean(e^2)) over the judged cycles from t = 0.3 s on (with that at 0.3 s if its t rounds up);
//                e = slip - slip_ref, or theta_est / theta - 1
//   settling     last entry into the band: |slip - slip_ref| <= 0.02, |theta_est - theta| <= 0.05 theta
//   variation    sum of |tau_k - tau_(k-1)| over phase brake, where both are known
//   locked       sum of the judged cycles' durations with slip > 0.95

#include <array>
#include <string_view>

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::analysis {

/// Car speed above which slip and its estimates are judged. Below it one encoder count is a large part of them.
inline constexpr double least_judged_speed_m_s = 3.0;

/// The figures of one run; `figures` says what each is. NaN if the run did not get that far or the backend cannot know
/// the value. Speeds and slip are true values if the backend knows them, else estimates.
template <class S>
struct FiguresOf {
  S brake_start_s{rig::unknown};
  S stop_time_s{rig::unknown};
  S stop_distance_m{rig::unknown};
  S slip_rms{rig::unknown};
  S slip_reached_s{rig::unknown};
  S slip_settling_s{rig::unknown};
  S slip_overshoot{rig::unknown};
  S slip_largest{rig::unknown};
  S time_locked_s{rig::unknown};
  S torque_total_variation_Nm{rig::unknown};
  S theta_final_N{rig::unknown};
  S theta_settling_s{rig::unknown};
  S theta_error_rms{rig::unknown};
  S theta_error_final{rig::unknown};
  S theta_error_max_N{rig::unknown};
  S final_speed_m_s{rig::unknown};
};
using Metrics = FiguresOf<double>;

/// Which of two values of a figure is the better one.
enum class Better { neither, less, nearer_zero };
[[nodiscard]] constexpr std::string_view name_of(Better better) noexcept {
  return better == Better::less ? "less" : better == Better::nearer_zero ? "nearer zero" : "neither";
}

/// A figure of merit. The order of the rows is that of a study's results.
struct Figure {
  std::string_view name;  ///< in summary, CSV and Python
  double Metrics::*value;
  std::string_view title;  ///< in tables for people
  std::string_view unit;
  int decimals;  ///< shown in tables
  Better better;
  bool compared;      ///< `abs_hil compare` shows it
  int summary_place;  ///< place in the run's summary, from 1; 0: not there
  std::string_view meaning;
  /// Why a run lacks it, for the summary's `missing`; names in braces stand for values. Empty: without a reason.
  std::string_view lacking;
  [[nodiscard]] double of(const Metrics& metrics) const noexcept { return metrics.*value; }
};

namespace lacking {
inline constexpr std::string_view stop =
    "the car still moved at {speed:.3g} m/s when the run ended; it stops below {end:.3g}";
}

/// A new figure is one row here, a member of FiguresOf, and the line that computes it below.
inline constexpr std::array<Figure, 16> figures{{
    {"brake_start_s", &Metrics::brake_start_s, "start of braking", "s", 3, Better::neither, false, 1,
     "first cycle in phase `brake`", "the run did not brake"},
    {"stop_time_s", &Metrics::stop_time_s, "stop time", "s", 3, Better::less, true, 2,
     "from there to the first tick with v_x below `experiment.end_speed_m_s`, whatever the phase; if the experiment "
     "ends "
     "at its estimate of that, at most 10 ms early, to the time at which its last deceleration leads there",
     lacking::stop},
    {"stop_distance_m", &Metrics::stop_distance_m, "stop distance", "m", 2, Better::less, true, 3,
     "trapezoid of v_x over the ticks between", lacking::stop},
    {"slip_rms", &Metrics::slip_rms, "slip RMS error", "", 4, Better::less, true, 4,
     "of slip − slip_ref, from 0.3 s after brake start on, to a cycle, and v_x > 3 m/s",
     "no braking above {judged:.3g} m/s later than {rms_start} s after its start"},
    {"slip_reached_s", &Metrics::slip_reached_s, "slip reached", "s", 3, Better::less, false, 5,
     "time after which slip is within 0.02 of its reference for the first time, while v_x > 3 m/s",
     "the slip never came within {slip_band} of the wanted one above {judged:.3g} m/s"},
    {"slip_settling_s", &Metrics::slip_settling_s, "slip settling", "s", 3, Better::less, true, 6,
     "time after which slip stays within 0.02 of its reference while v_x > 3 m/s",
     "the slip was not within {slip_band} of the wanted one in the last cycle above {judged:.3g} m/s"},
    {"slip_overshoot", &Metrics::slip_overshoot, "slip overshoot", "", 4, Better::less, true, 10,
     "largest excess of slip over slip_ref while v_x > 3 m/s, at least 0", ""},
    {"slip_largest", &Metrics::slip_largest, "largest slip", "", 4, Better::less, false, 11,
     "largest slip while v_x > 3 m/s", ""},
    {"time_locked_s", &Metrics::time_locked_s, "time locked", "s", 3, Better::less, true, 12,
     "braking time with slip > 0.95 while v_x > 3 m/s", ""},
    {"torque_total_variation_Nm", &Metrics::torque_total_variation_Nm, "torque variation", "N m", 1, Better::less, true,
     9, "sum of the absolute steps of the requested torque, over phase `brake`: measures chatter", ""},
    {"theta_final_N", &Metrics::theta_final_N, "theta at 3 m/s", "N", 2, Better::neither, false, 7,
     "the estimate at 3 m/s: that of the last cycle with v_x > 3 m/s, not the one at the end of the run",
     "no estimate at {judged:.3g} m/s; the run ended at {speed:.3g} m/s"},
    {"theta_settling_s", &Metrics::theta_settling_s, "theta settling", "s", 3, Better::less, true, 8,
     "time after which the estimate stays within 5 % of the truth while v_x > 3 m/s",
     "no estimate within {theta_per_cent} % of a known theta in the last cycle above {judged:.3g} m/s"},
    {"theta_error_rms", &Metrics::theta_error_rms, "theta RMS error", "", 4, Better::less, true, 14,
     "of estimate / truth − 1, over the samples of slip_rms",
     "no braking above {judged:.3g} m/s later than {rms_start} s after its start, or a cycle of it lacks an estimate "
     "or a known theta"},
    {"theta_error_final", &Metrics::theta_error_final, "theta error at end", "", 4, Better::nearer_zero, true, 13,
     "theta_final_N / true theta at that time − 1",
     "no estimate of a known theta at {judged:.3g} m/s; the run ended at {speed:.3g} m/s"},
    {"theta_error_max_N", &Metrics::theta_error_max_N, "largest theta error", "N", 2, Better::less, false, 15,
     "largest abs(θ̂ − θ), over the samples of slip_rms", ""},
    {"final_speed_m_s", &Metrics::final_speed_m_s, "final speed", "m/s", 3, Better::neither, false, 0,
     "v_x of the last record", ""},
}};
static_assert(sizeof(Metrics) == figures.size() * sizeof(double), "each figure has a row");

/// What the metrics of braking need of one cycle.
template <class S>
struct BrakingSample {
  S time_s{0.0};
  S v_x_m_s{0.0};
  S distance_m{0.0};  ///< since the start of braking
  S slip{0.0};
  S slip_ref{0.0};
  S torque_ref_Nm{0.0};
  S theta_est_N{0.0};
  S theta_N{0.0};
};

/// Time since which a quantity has stayed within its band, from the start of braking.
template <class S>
class Settling {
 public:
  template <class Condition>
  void observe(const Condition& judged, const S& since_brake_s, const Condition& inside) noexcept {
    since_s_ = rig::select(judged && inside && !(settled_ > 0.0), since_brake_s, since_s_);
    settled_ = rig::select(judged, rig::select(inside, S(1.0), S(0.0)), settled_);
  }
  [[nodiscard]] S since_s() const noexcept { return rig::select(settled_ > 0.0, since_s_, S(rig::unknown)); }

 private:
  S settled_{0.0};  ///< 1 or 0
  S since_s_{rig::unknown};
};

/// The figures from the first cycle of braking on, as far as they are known; `metrics_of` (analysis/run_metrics.hpp)
/// completes them. `S` is a `double`, or a pack of them (rig/scalar.hpp).
template <class S>
class BrakingFigures : public FiguresOf<S> {
 public:
  using FiguresOf<S>::brake_start_s, FiguresOf<S>::stop_time_s, FiguresOf<S>::stop_distance_m;
  using FiguresOf<S>::slip_reached_s, FiguresOf<S>::slip_overshoot, FiguresOf<S>::slip_largest;
  using FiguresOf<S>::time_locked_s, FiguresOf<S>::torque_total_variation_Nm, FiguresOf<S>::theta_final_N;
  using FiguresOf<S>::theta_error_final, FiguresOf<S>::theta_error_max_N, FiguresOf<S>::final_speed_m_s;

  BrakingFigures() = default;
  explicit BrakingFigures(const S& end_speed_m_s) noexcept : end_speed_m_s_(end_speed_m_s) {}

  static constexpr double rms_start_s = 0.3;
  static constexpr double slip_band = 0.02;
  static constexpr double theta_band = 0.05;

  /// @param braking  the cycle is in phase brake; it is in the first one
  template <class Condition>
  void note(const BrakingSample<S>& sample, const Condition& braking) noexcept;

  [[nodiscard]] auto stop_known() const noexcept { return !rig::is_nan(stop_time_s); }
  [[nodiscard]] S end_speed_m_s() const noexcept { return end_speed_m_s_; }

  S slip_square_sum{0.0};
  S theta_square_sum{0.0};
  S samples{0.0};  ///< in the two sums
  S last_time_s{rig::unknown};
  S last_distance_m{0.0};
  S deceleration_m_s2{0.0};  ///< over the last interval of at least 10 ms
  Settling<S> slip_settling{};
  Settling<S> theta_settling{};

 private:
  template <class Condition>
  void note_braking(const BrakingSample<S>& sample, const Condition& braking, const S& since_brake_s) noexcept;
  void note_deceleration(const S& time_s, const S& v_x_m_s) noexcept;

  S end_speed_m_s_{0.0};
  S interval_start_s_{rig::unknown};
  S interval_start_m_s_{0.0};
  S last_torque_Nm_{rig::unknown};
};

template <class S>
template <class Condition>
void BrakingFigures<S>::note(const BrakingSample<S>& sample, const Condition& braking) noexcept {
  brake_start_s = rig::select(rig::is_nan(brake_start_s), sample.time_s, brake_start_s);
  const S since_brake_s = sample.time_s - brake_start_s;
  final_speed_m_s = sample.v_x_m_s;
  last_distance_m = sample.distance_m;
  note_deceleration(sample.time_s, sample.v_x_m_s);
  if (rig::any(braking)) note_braking(sample, braking, since_brake_s);
  last_time_s = sample.time_s;
  const auto stops = !stop_known() && since_brake_s > 0.0 && sample.v_x_m_s < end_speed_m_s_;
  stop_time_s = rig::select(stops, since_brake_s, stop_time_s);
  stop_distance_m = rig::select(stops, sample.distance_m, stop_distance_m);
}

template <class S>
template <class Condition>
void BrakingFigures<S>::note_braking(const BrakingSample<S>& sample, const Condition& braking,
                                     const S& since_brake_s) noexcept {
  // A wheel below a twentieth of the car's speed can be steered no better than a locked one.
  constexpr double locked_slip = 0.95;

  const S step_Nm = rig::magnitude(S(sample.torque_ref_Nm - last_torque_Nm_));
  const auto begins = braking && rig::is_nan(torque_total_variation_Nm) && !rig::is_nan(sample.torque_ref_Nm);
  const S before_Nm = rig::select(begins, S(0.0), torque_total_variation_Nm);
  torque_total_variation_Nm = rig::select(braking && !rig::is_nan(step_Nm), S(before_Nm + step_Nm), before_Nm);
  last_torque_Nm_ = rig::select(braking, sample.torque_ref_Nm, last_torque_Nm_);
  // Slower than this the slip dynamics stiffen as 1 / v_x and the paper calls the performance "no longer relevant".
  const auto judged = braking && sample.v_x_m_s > least_judged_speed_m_s;
  if (!rig::any(judged)) return;

  const S slip_error = sample.slip - sample.slip_ref;
  const S over = rig::select(slip_error > 0.0, slip_error, S(0.0));
  const auto further = judged && (rig::is_nan(slip_overshoot) || slip_overshoot < over);
  slip_overshoot = rig::select(further, over, slip_overshoot);
  const auto largest = judged && (rig::is_nan(slip_largest) || slip_largest < sample.slip);
  slip_largest = rig::select(largest, sample.slip, slip_largest);
  time_locked_s = rig::select(judged && rig::is_nan(time_locked_s), S(0.0), time_locked_s);
  const auto locked = judged && sample.slip > locked_slip && !rig::is_nan(last_time_s);
  time_locked_s = rig::select(locked, S(time_locked_s + (sample.time_s - last_time_s)), time_locked_s);
  const auto in_band = rig::magnitude(slip_error) <= slip_band;
  slip_reached_s = rig::select(judged && in_band && rig::is_nan(slip_reached_s), since_brake_s, slip_reached_s);
  slip_settling.observe(judged, since_brake_s, in_band);
  theta_final_N = rig::select(judged, sample.theta_est_N, theta_final_N);
  const S theta_relative = sample.theta_est_N / sample.theta_N - 1.0;
  theta_error_final = rig::select(judged, theta_relative, theta_error_final);
  const auto counted = judged && since_brake_s > rms_start_s;
  slip_square_sum = rig::select(counted, S(slip_square_sum + slip_error * slip_error), slip_square_sum);
  theta_square_sum = rig::select(counted, S(theta_square_sum + theta_relative * theta_relative), theta_square_sum);
  samples = rig::select(counted, S(samples + 1.0), samples);
  const S theta_error_N = rig::magnitude(S(sample.theta_est_N - sample.theta_N));
  const auto worse = counted && (rig::is_nan(theta_error_max_N) || theta_error_max_N < theta_error_N);
  theta_error_max_N = rig::select(worse, theta_error_N, theta_error_max_N);
  theta_settling.observe(judged, since_brake_s, theta_error_N <= theta_band * sample.theta_N);
}

template <class S>
void BrakingFigures<S>::note_deceleration(const S& time_s, const S& v_x_m_s) noexcept {
  constexpr double interval_s = 0.01;
  const auto over = !(time_s - interval_start_s_ < interval_s);
  if (!rig::any(over)) return;
  const S deceleration = (interval_start_m_s_ - v_x_m_s) / (time_s - interval_start_s_);
  deceleration_m_s2 = rig::select(over && !rig::is_nan(interval_start_s_), deceleration, deceleration_m_s2);
  interval_start_s_ = rig::select(over, time_s, interval_start_s_);
  interval_start_m_s_ = rig::select(over, v_x_m_s, interval_start_m_s_);
}

}  // namespace abs_hil::analysis
