// Metrics of made-up brakings whose figures are known in closed form.
#include "analysis/run_metrics.hpp"

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::analysis;
using Catch::Matchers::WithinAbs;

namespace {

/// A car that brakes at 5 m/s^2 from 10 m/s to `last_m_s`, where the sequence ends.
Metrics brake_to(double last_m_s, rig::Phase last_phase, double estimate_m_s = 0.29) {
  RunMetrics metrics(0.1, 0.3);
  const auto at = [&](double time_s, rig::Phase phase, double estimate) {
    rig::CycleRecord record;
    record.time_s = time_s;
    record.phase = phase;
    record.truth.speeds = {0.0, (10.0 - 5.0 * time_s) / 0.1};
    record.truth.theta_N = record.control.theta_est_N = 20.0;
    record.control.speeds_est = {0.0, estimate / 0.1};
    metrics.consume(record, 10.0 * time_s - 2.5 * time_s * time_s);
  };
  const double end_s = (10.0 - last_m_s) / 5.0;
  for (int tick = 0; 1e-3 * tick < end_s - 1e-6; ++tick) at(1e-3 * tick, rig::Phase::brake, 10.0 - 5e-3 * tick);
  at(end_s, last_phase, estimate_m_s);
  return metrics.metrics();
}

constexpr double r2_m = 0.1;
constexpr double start_m_s = 10.0;
constexpr double deceleration_m_s2 = 5.0;

/// A car that brakes at a constant 5 m/s^2 from 10 m/s, starting at 1 s, with the given slip and estimate.
template <typename Slip, typename Theta>
Metrics brake(Slip slip, Theta theta_est_N, double end_speed_m_s = 0.5, bool truth = true) {
  RunMetrics metrics(r2_m, end_speed_m_s);
  double distance_m = 0.0;
  double last_v_m_s = start_m_s;
  for (int tick = 0; tick <= 4000; ++tick) {
    const double time_s = 1e-3 * tick;
    const double since_s = time_s - 1.0;
    const double v_m_s = since_s <= 0.0 ? start_m_s : std::max(0.0, start_m_s - deceleration_m_s2 * since_s);
    if (since_s > 0.0) distance_m += 0.5e-3 * (v_m_s + last_v_m_s);
    last_v_m_s = v_m_s;
    rig::CycleRecord record;
    record.time_s = time_s;
    record.phase = since_s < 0.0 ? rig::Phase::accelerate : rig::Phase::brake;
    rig::WheelSpeeds speeds{0.0, v_m_s / r2_m};
    if (truth) {
      record.truth.speeds = speeds;
      record.truth.slip = slip(since_s);
      record.truth.theta_N = 20.0;
    } else {
      record.control.speeds_est = speeds;
      record.control.slip_est = slip(since_s);
    }
    record.control.slip_ref = 0.15;
    record.control.theta_est_N = theta_est_N(since_s);
    record.control.brake_torque_ref_Nm = tick % 2 == 0 ? 1.0 : 1.5;
    metrics.consume(record, distance_m);
  }
  return metrics.metrics();
}

constexpr auto on_target = [](double) { return 0.15; };
constexpr auto exact = [](double) { return 20.0; };

}  // namespace

TEST_CASE("stop time and distance of a constant deceleration") {
  const Metrics m = brake(on_target, exact);
  CHECK_THAT(m.brake_start_s, WithinAbs(1.0, 1e-9));
  // First tick below 0.5 m/s: 9.5 / 5 = 1.9 s is not below it yet.
  CHECK_THAT(m.stop_time_s, WithinAbs(1.901, 1e-9));
  CHECK_THAT(m.stop_distance_m, WithinAbs(10.0 * 1.901 - 2.5 * 1.901 * 1.901, 1e-6));
}

TEST_CASE("slip RMS covers only t > 0.3 s and v_x > 3 m/s") {
  const auto slip = [](double since_s) {
    // One tick wider than the counted range, so that rounding of the end ticks does not matter.
    const bool counted = since_s > 0.2995 && start_m_s - deceleration_m_s2 * since_s > 2.9995;
    return counted ? 0.15 + 0.02 : 0.9;
  };
  CHECK_THAT(brake(slip, exact).slip_rms, WithinAbs(0.02, 1e-9));
}

TEST_CASE("settling is the start of the last stay within the band") {
  const auto slip = [](double since_s) { return since_s < 0.2 || (since_s > 0.4 && since_s < 0.5) ? 0.3 : 0.16; };
  const auto theta = [](double since_s) { return since_s < 0.25 ? 0.0 : 20.9; };
  const Metrics m = brake(slip, theta);
  CHECK_THAT(m.slip_settling_s, WithinAbs(0.5, 1.1e-3));
  CHECK_THAT(m.theta_settling_s, WithinAbs(0.25, 1.1e-3));
  CHECK(m.theta_final_N == 20.9);
}

TEST_CASE("the wanted slip is reached where the slip first comes within the band above 3 m/s") {
  // It reaches, leaves, comes back; the other one comes near from above, the third below 3 m/s (1.4 s) only.
  const auto twice = [](double since_s) { return since_s < 0.2 || (since_s > 0.4 && since_s < 0.5) ? 0.3 : 0.135; };
  CHECK_THAT(brake(twice, exact).slip_reached_s, WithinAbs(0.2, 1.1e-3));
  CHECK_THAT(brake([](double since_s) { return since_s < 0.1 ? 0.171 : 0.169; }, exact).slip_reached_s,
             WithinAbs(0.1, 1.1e-3));
  CHECK(std::isnan(brake([](double since_s) { return since_s < 1.4005 ? 0.129 : 0.15; }, exact).slip_reached_s));
}

TEST_CASE("the largest error of theta counts from 0.3 s on and above 3 m/s, with either sign") {
  const auto theta = [](double since_s) {
    if (since_s < 0.2995 || since_s > 1.4005) return 90.0;
    return since_s < 0.7 ? 26.0 : 13.5;
  };
  CHECK_THAT(brake(on_target, theta).theta_error_max_N, WithinAbs(6.5, 1e-12));
  CHECK(std::isnan(brake(on_target, [](double) { return std::nan(""); }).theta_error_max_N));
  CHECK(std::isnan(brake(on_target, theta, 0.5, false).theta_error_max_N));
}

TEST_CASE("a quantity that never settles has no settling time") {
  const Metrics m = brake([](double) { return 0.5; }, [](double) { return 10.0; });
  CHECK(std::isnan(m.slip_settling_s));
  CHECK(std::isnan(m.theta_settling_s));
}

TEST_CASE("the estimate of theta settles within 5 % of the true theta, not of itself") {
  // The bands of 20 N, 19 to 21 N; an estimate's own 5 % would end at 19.05 and at 21.05.
  CHECK_THAT(brake(on_target, [](double) { return 19.02; }).theta_settling_s, WithinAbs(0.0, 1.1e-3));
  CHECK(std::isnan(brake(on_target, [](double) { return 21.03; }).theta_settling_s));
}

TEST_CASE("each missing figure says why, and no other") {
  const auto why = [](const Metrics& m, std::string_view name) -> std::string {
    for (const MissingFigure& figure : missing_figures(m, 0.3)) {
      if (figure.name == name) return figure.why;
    }
    return {};
  };
  const auto names = [](const Metrics& m) {
    std::vector<std::string_view> all;
    for (const MissingFigure& figure : missing_figures(m, 0.3)) all.push_back(figure.name);
    return all;
  };
  RunMetrics nothing(r2_m, 0.3);
  nothing.consume({}, 0.0);
  for (const MissingFigure& figure : missing_figures(nothing.metrics(), 0.3)) {
    CHECK(figure.why == "the run did not brake");
  }
  CHECK(names(nothing.metrics()).size() == 10);
  CHECK(names(brake(on_target, exact)).empty());
  const Metrics moving = brake_to(0.36, rig::Phase::stopped);
  CHECK_THAT(why(moving, "stop_time_s"), Catch::Matchers::Contains("still moved at 0.36 m/s"));
  const Metrics unsettled = brake([](double) { return 0.5; }, [](double) { return 10.0; });
  CHECK(names(unsettled) == std::vector<std::string_view>{"slip_reached_s", "slip_settling_s", "theta_settling_s"});
  CHECK_THAT(why(unsettled, "slip_reached_s"), Catch::Matchers::Contains("never came within 0.02"));
  CHECK_THAT(why(unsettled, "slip_settling_s"), Catch::Matchers::Contains("0.02"));
  CHECK_THAT(why(unsettled, "theta_settling_s"), Catch::Matchers::Contains("5 %"));
  // The estimates are right until a phase without a controller begins.
  const Metrics ended = brake(on_target, [](double since_s) { return since_s < 1.0 ? 20.0 : std::nan(""); });
  CHECK(names(ended) ==
        std::vector<std::string_view>{"theta_final_N", "theta_settling_s", "theta_error_rms", "theta_error_final"});
  CHECK_THAT(why(ended, "theta_settling_s"), Catch::Matchers::Contains("in the last cycle above 3 m/s"));
  CHECK_THAT(why(ended, "theta_error_rms"), Catch::Matchers::Contains("a cycle of it lacks an estimate"));
  const Metrics silent = brake(on_target, [](double) { return std::nan(""); });
  CHECK_THAT(why(silent, "theta_final_N"), Catch::Matchers::Contains("no estimate"));
}

TEST_CASE("a braking that ends above 3 m/s has no estimate of theta there") {
  const Metrics cut_off = brake_to(4.0, rig::Phase::fault);
  CHECK(std::isnan(cut_off.theta_final_N));
  CHECK(std::isnan(cut_off.theta_error_final));
  int named = 0;
  for (const MissingFigure& figure : missing_figures(cut_off, 0.3)) {
    if (figure.name != "theta_final_N" && figure.name != "theta_error_final") continue;
    CHECK_THAT(figure.why, Catch::Matchers::Contains("at 3 m/s; the run ended at 4 m/s"));
    ++named;
  }
  CHECK(named == 2);
  CHECK(brake_to(2.9, rig::Phase::fault).theta_final_N == 20.0);
  CHECK(brake(on_target, exact, 5.0).theta_final_N == 20.0);  // it has stopped by its own end speed
}

TEST_CASE("total variation sums the steps of the torque reference") {
  const Metrics m = brake(on_target, exact);
  CHECK_THAT(m.torque_total_variation_Nm, WithinAbs(3000 * 0.5, 1e-6));
}

TEST_CASE("a gap of the torque reference adds no step and loses none, and without any value there is no variation") {
  const auto variation = [](const std::vector<double>& torques_Nm) {
    RunMetrics metrics(r2_m, 0.5);
    rig::CycleRecord record;
    record.phase = rig::Phase::brake;
    record.truth.speeds = {0.0, 100.0};
    for (const double torque_Nm : torques_Nm) {
      record.time_s += 1e-3;
      record.control.brake_torque_ref_Nm = torque_Nm;
      metrics.consume(record, 0.0);
    }
    return metrics.metrics().torque_total_variation_Nm;
  };
  const double gap = std::nan("");
  CHECK(variation({1.0, 3.0, gap, gap, 7.0, 6.5}) == 2.5);
  CHECK(variation({gap, 1.0, 3.0, gap}) == 2.0);
  CHECK(variation({2.0}) == 0.0);
  CHECK(std::isnan(variation({gap, gap})));
}

TEST_CASE("overshoot is the largest excess of slip over its reference above 3 m/s") {
  const auto peak = [](double since_s) { return since_s > 0.5 && since_s < 0.6 ? 0.25 : (since_s > 1.45 ? 1.0 : 0.1); };
  CHECK_THAT(brake(peak, exact).slip_overshoot, WithinAbs(0.10, 1e-12));
  CHECK(brake([](double) { return 0.1; }, exact).slip_overshoot == 0.0);
  CHECK(brake(peak, exact).slip_largest == 0.25);
  CHECK(brake([](double) { return -0.1; }, exact).slip_largest == -0.1);
}

TEST_CASE("time locked counts the cycles with slip above 0.95 and v_x above 3 m/s") {
  // 0.25 s at high speed count; from 3 m/s (1.4 s) on the wheel may lock.
  const auto slip = [](double since_s) {
    return (since_s > 0.4995 && since_s < 0.7495) || since_s > 1.3995 ? 0.96 : 0.15;
  };
  CHECK_THAT(brake(slip, exact).time_locked_s, WithinAbs(0.25, 1e-9));
  CHECK(brake([](double) { return 0.94; }, exact).time_locked_s == 0.0);
}

TEST_CASE("errors of the estimate of theta are relative to the truth") {
  const auto theta = [](double since_s) { return since_s < 0.25 ? 0.0 : 22.0; };
  const Metrics m = brake(on_target, theta);
  CHECK_THAT(m.theta_error_final, WithinAbs(0.1, 1e-12));
  CHECK_THAT(m.theta_error_rms, WithinAbs(0.1, 1e-12));
  CHECK(std::isnan(brake(on_target, theta, 0.5, false).theta_error_rms));
}

TEST_CASE("the metrics are complete once the stop is known and phase brake is over") {
  RunMetrics metrics(r2_m, 0.5);
  rig::CycleRecord record;
  record.truth = {.speeds = {0.0, 10.0}, .slip = 0.15, .brake_torque_Nm = 1.0, .theta_N = 20.0};
  metrics.consume(record, 0.0);
  CHECK_FALSE(metrics.complete());
  record.phase = rig::Phase::brake;
  metrics.consume(record, 0.0);
  record.time_s = 0.1;
  record.truth.speeds.omega2_rad_s = 1.0;
  metrics.consume(record, 0.0);
  CHECK(metrics.metrics().stop_time_s == 0.1);
  CHECK_FALSE(metrics.complete());
  record.phase = rig::Phase::hold;
  metrics.consume(record, 0.0);
  CHECK(metrics.complete());
}

TEST_CASE("without true values the metrics use estimates, and theta has no settling time") {
  const Metrics m = brake(on_target, exact, 0.5, false);
  CHECK_THAT(m.stop_time_s, WithinAbs(1.901, 1e-9));
  CHECK_THAT(m.slip_rms, WithinAbs(0.0, 1e-12));
  CHECK(std::isnan(m.theta_settling_s));
}

TEST_CASE("a run that never brakes has no metrics") {
  RunMetrics metrics(r2_m, 0.3);
  metrics.consume({}, 0.0);
  CHECK(std::isnan(metrics.metrics().brake_start_s));
  CHECK(std::isnan(metrics.metrics().stop_time_s));
}

TEST_CASE("a sequence that ends a little above the end speed has its stop where its deceleration leads") {
  for (const double last_m_s : {0.3002, 0.33, 0.345}) {
    const Metrics m = brake_to(last_m_s, rig::Phase::stopped);
    CHECK_THAT(m.stop_time_s, WithinAbs(9.7 / 5.0, 1e-6));
    CHECK_THAT(m.stop_distance_m, WithinAbs((100.0 - 0.09) / 10.0, 1e-6));
  }
  CHECK(std::isnan(brake_to(0.36, rig::Phase::stopped).stop_time_s));       // 12 ms ahead
  CHECK(std::isnan(brake_to(0.33, rig::Phase::stopped, 0.4).stop_time_s));  // not stopped by its own estimate
  CHECK(std::isnan(brake_to(0.33, rig::Phase::fault).stop_time_s));
  CHECK(std::isnan(brake_to(0.33, rig::Phase::brake).stop_time_s));
}

TEST_CASE("a car that moves again after its stop has not stopped") {
  RunMetrics metrics(0.1, 0.3);
  double time_s = 0.0;
  const auto at = [&](rig::Phase phase, double speed_m_s) {
    rig::CycleRecord record;
    record.time_s = time_s += 1e-3;
    record.phase = phase;
    record.control.speeds_est = {0.0, speed_m_s / 0.1};
    metrics.consume(record, 0.0);
  };
  at(rig::Phase::accelerate, 5.0);
  CHECK_FALSE(metrics.moves_on());  // it has not braked
  at(rig::Phase::brake, 5.0);
  CHECK(metrics.moves_on());
  at(rig::Phase::brake, 0.29);
  CHECK_FALSE(metrics.moves_on());
  at(rig::Phase::stopped, 4.0);
  CHECK(metrics.moves_on());
  at(rig::Phase::stopped, 0.0);
  CHECK_FALSE(metrics.moves_on());
}
