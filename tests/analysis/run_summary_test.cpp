// A run's summary, as text and as JSON: what it holds, and what it says of what is missing.
#include "analysis/run_summary.hpp"

#include <string>

#include "catch.hpp"

using namespace abs_hil::analysis;
using Catch::Matchers::Contains;

TEST_CASE("the summary has the fields that scripts need, and null for unknown values") {
  RunSummary summary;
  summary.metrics.stop_time_s = 2.5;
  const auto json = to_json(summary);
  for (const char* field : {"result",
                            "reason",
                            "controller",
                            "plant",
                            "backend",
                            "brake_start_s",
                            "stop_time_s",
                            "stop_distance_m",
                            "slip_rms",
                            "slip_reached_s",
                            "slip_settling_s",
                            "theta_final_N",
                            "theta_settling_s",
                            "torque_total_variation_Nm",
                            "slip_overshoot",
                            "slip_largest",
                            "time_locked_s",
                            "theta_error_final",
                            "theta_error_rms",
                            "theta_error_max_N",
                            "cycles",
                            "overruns",
                            "wakeup_latency_us",
                            "cycle_time_us",
                            "telemetry_drops",
                            "config"}) {
    INFO(field);
    CHECK(json.contains(field));
  }
  CHECK(json["stop_time_s"] == 2.5);
  CHECK(json["slip_rms"].is_null());
  for (const char* quantile : {"p50", "p99", "p99_9", "max"}) CHECK(json["wakeup_latency_us"].contains(quantile));
}

TEST_CASE("every part of the cycle has its quantiles, and late cycles their causes") {
  RunSummary summary;
  summary.realtime = true;
  summary.telemetry_drops = 3;
  summary.timing.read = {1.0, 2.0, 3.0, 4.0};
  summary.timing.overruns = {
      .total = 15, .startup = 6, .ticks_missed = 40, .longest_run = 7, .by_cause = {0, 1, 2, 3, 4, 5}};
  const auto json = to_json(summary);
  for (const char* part : {"wakeup_latency_us", "read_us", "control_us", "write_us", "cycle_time_us"}) {
    for (const char* quantile : {"p50", "p99", "p99_9", "max"}) CHECK(json[part].contains(quantile));
  }
  CHECK(json["read_us"]["p99_9"] == 3.0);
  CHECK(json["overruns"] == 15);
  CHECK(json["overruns_by_cause"].dump() == R"({"wakeup":1,"read":2,"control":3,"write":4,"record":5})");
  CHECK(json["overruns_startup"] == 6);
  CHECK(json["overruns_longest_run"] == 7);
  CHECK(json["ticks_missed"] == 40);
  CHECK(json["telemetry_drops"] == 3);
  CHECK_THAT(to_text(summary),
             Contains("control 3") && Contains("at most 7 in a row") && Contains("3 records dropped"));
}

TEST_CASE("the text says if real time was not obtained and if there are no true values") {
  RunSummary summary;
  CHECK_THAT(to_text(summary), Contains("NOT obtained") && Contains("estimates"));
  summary.realtime = true;
  summary.truth_known = true;
  CHECK_THAT(to_text(summary), !Contains("NOT obtained") && !Contains("estimates: "));
  summary.virtual_time = true;
  CHECK_THAT(to_text(summary), Contains("virtual time"));
}

TEST_CASE("the text and the JSON give both values where model and plant differ") {
  RunSummary summary;
  CHECK_THAT(to_text(summary), !Contains("differs from plant"));
  summary.plant = "a";
  CHECK(to_json(summary)["model"] == "a");
  summary.model = "b";
  summary.model_note = "theta_N 23 (plant 40)";
  summary.model_differences["theta_N"] = {{"model", 23}, {"plant", 40}};
  CHECK_THAT(to_text(summary), Contains("differs from plant: theta_N 23 (plant 40)"));
  CHECK(to_json(summary)["model"] == "b");
  CHECK(to_json(summary)["model_differences"]["theta_N"]["plant"] == 40);
}

TEST_CASE("the summary says why a figure is missing") {
  RunSummary summary;
  summary.end_speed_m_s = 0.3;
  CHECK(to_json(summary)["missing"]["stop_time_s"] == "the run did not brake");
  summary.metrics.brake_start_s = 1.0;
  summary.metrics.final_speed_m_s = 0.875;
  CHECK_THAT(to_json(summary)["missing"]["stop_distance_m"].get<std::string>(), Contains("0.875") && Contains("0.3"));
  CHECK_THAT(to_text(summary), Contains("still moved at 0.875 m/s"));
  summary.metrics.stop_time_s = summary.metrics.stop_distance_m = 2.0;
  CHECK_FALSE(to_json(summary)["missing"].contains("stop_time_s"));
  CHECK_FALSE(to_json(summary)["missing"].contains("brake_start_s"));
  CHECK_THAT(to_text(summary), !Contains("still moved"));
}

TEST_CASE("the text says at which speed the estimate of theta is taken") {
  RunSummary summary;
  summary.metrics.theta_final_N = 23.04;
  CHECK_THAT(to_text(summary), Contains("23.04 N at 3 m/s"));
}

TEST_CASE("text and JSON have the same estimate of theta") {
  RunSummary summary;
  summary.metrics.brake_start_s = 1.0;
  summary.metrics.theta_final_N = 0.0;
  summary.metrics.final_speed_m_s = 16.6;
  CHECK_THAT(to_text(summary), Contains("0.00 N at 17 m/s"));
  CHECK(to_json(summary)["theta_final_N"] == 0.0);
  summary.metrics.theta_final_N = abs_hil::rig::unknown;
  CHECK_THAT(to_text(summary), Contains("theta estimate        - (the run ended at 16.6 m/s)"));
  CHECK_THAT(to_json(summary)["missing"]["theta_final_N"].get<std::string>(), Contains("ended at 16.6 m/s"));
}
