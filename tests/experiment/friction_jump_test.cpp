// The experiment friction-jump: its road, what the estimate makes of it, and stops of the maker's plant.
#include <cmath>

#include "catch.hpp"
#include "config/script.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

Setup friction_jump(Setup setup) {
  setup.experiment.name = "friction-jump";
  setup.plant.friction_profile = config::profile(*config::find(setup.experiment.name), "friction");
  return setup;
}

/// The maker's model (config/plants/inteco-manual.toml).
Setup on_makers_plant(Setup setup) {
  setup.plant.rig.wheels.J1_kg_m2 = 7.53e-3;
  setup.plant.rig.tyre = {34.31, 19.49, 1.2694};
  setup.plant.tyre = "inteco-mu";
  setup.plant.load = "lever";
  return setup;
}

}  // namespace

TEST_CASE("only friction-jump has a changing road") {
  CHECK(config::profile(*config::find("friction-jump"), "friction") == "braking time: 1; 0.521739 at 0.6; 1 at 1");
  CHECK(config::profile(*config::find("paper"), "friction").empty());
}

TEST_CASE("friction-jump takes theta from 23 to 12 and back to 23 N in mid-braking, after a run-up or at once") {
  for (const Setup& start : {Setup{}, braking("adaptive")}) {
    const Result result = simulated(friction_jump(start));
    REQUIRE(result.outcome.completed());
    int low = 0;
    for (const auto& record : result.records) {
      const double since_s = record.time_s - result.metrics.brake_start_s;
      const bool in_patch = since_s > 0.6 - 1e-9 && since_s < 1.0 - 1e-9;
      REQUIRE_THAT(record.truth.theta_N, WithinAbs(in_patch ? 12.0 : 23.0, 1e-4));
      low += in_patch ? 1 : 0;
      if (in_patch) CHECK(record.truth.speeds.omega2_rad_s * 0.0990 > 3.0);
    }
    CHECK(low == 400);
    // 0.4 s of less grip cost time and distance compared with the same run without.
    const Result plain = simulated(start);
    CHECK(result.metrics.stop_time_s > plain.metrics.stop_time_s + 0.1);
    CHECK(result.metrics.stop_distance_m > plain.metrics.stop_distance_m + 1.0);
  }
}

TEST_CASE("the adaptive controller's estimate follows both jumps of friction-jump") {
  const Result result = simulated(friction_jump(ideal_braking("adaptive")));
  for (const auto& record : result.records) {
    const double since_s = record.time_s - result.metrics.brake_start_s;
    if (std::abs(since_s - 0.95) < 1e-4) CHECK_THAT(record.control.theta_est_N, WithinRel(12.0, 0.05));
    if (std::abs(since_s - 1.35) < 1e-4) CHECK_THAT(record.control.theta_est_N, WithinRel(23.0, 0.05));
  }
  CHECK_THAT(result.metrics.theta_final_N, WithinRel(23.0, 0.02));
}

TEST_CASE("under slip control at 0.15 the maker's plant stops in 1.245 s within 10.49 m") {
  Setup setup = on_makers_plant(ideal_braking("nominal"));
  setup.experiment.end_speed_m_s = setup.control.v_min_m_s = 0.1;
  const Result result = simulated(setup);
  REQUIRE(result.outcome.completed());
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(1.245, 0.02));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(10.49, 0.02));
}

TEST_CASE("the nominal parameters of the maker's plant fit it: theta's estimate is within 5 % of the truth") {
  for (const Setup& start : {ideal_braking("adaptive"), braking("adaptive")}) {
    const Result result = simulated(on_makers_plant(start));
    REQUIRE(result.outcome.completed());
    CHECK_THAT(result.metrics.theta_final_N, WithinRel(34.31, 0.05));
    CHECK(result.metrics.theta_settling_s < 0.3);  // NaN fails
    CHECK(result.metrics.slip_rms < 0.03);
  }
}
