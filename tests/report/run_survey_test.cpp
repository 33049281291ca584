#include "report/run_survey.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "catch.hpp"
#include "report/csv_reader.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::report {
namespace {

/// Changes of a rig that rolls at 10 m/s and brakes from 1 s on with 2 m/s^2, with a row every 10 ms.
std::vector<PlantChange> changes_along(const std::string& key, const std::string& profile, bool truth_known = true) {
  constexpr double r2_m = 0.1;
  const test::TemporaryFolder folder;
  RunFiles run;
  run.csv = folder / "run.csv";
  run.config["plant.r2_m"] = fmt::format("{}", r2_m);
  run.config[key] = profile;
  std::ofstream csv(run.csv);
  csv << fmt::format("{}\n", fmt::join(contract_columns(), ","));
  for (int i = 0; i <= 300; ++i) {
    const double time_s = i * 0.01;
    const double braking_s = std::max(0.0, time_s - 1.0);
    const double omega2_rad_s = truth_known ? (10.0 - 2.0 * braking_s) / r2_m : NAN;
    csv << fmt::format("{},{},1,{},1,1,0,0,0.1,0,0,0,0,0,0,23,23,0,0\n", time_s, i < 100 ? "coast" : "brake",
                       truth_known ? fmt::format("{}", omega2_rad_s) : "NaN");
  }
  csv.close();
  return survey(run).plant_changes;
}

TEST_CASE("Changes over time are marked at their instants") {
  const auto changes = changes_along("plant.brake_torque_profile", "time: 1; 0.5 at 0.255; 1 from 1.5 to 2; 0.7 at 9");
  REQUIRE(changes.size() == 3);
  CHECK(changes[0].time_s == 0.255);
  CHECK(changes[0].label == "brake torque × 0.5");
  CHECK(changes[1].label == "brake torque drifts");
  CHECK(changes[2].time_s == 2.0);
  CHECK(changes[2].label == "brake torque × 1");
  const auto braking = changes_along("plant.friction_profile", "braking time: 1; 0.5 at 0.25");
  REQUIRE(braking.size() == 1);
  CHECK(braking[0].time_s == 1.25);
}

TEST_CASE("Changes over distance are marked at the first row that reached the distance") {
  // 10 m/s: 4.995 m after 0.4995 s. From 1 s on s = 10 m + 10 t - t^2: 14 m at t = 5 - sqrt(21) = 0.41742 s.
  const auto changes = changes_along("plant.friction_profile", "distance: 1; 0.5 at 4.995; 1 at 14; 0.7 at 100");
  REQUIRE(changes.size() == 2);
  CHECK(std::abs(changes[0].time_s - 0.50) < 1e-9);
  CHECK(changes[0].label == "friction × 0.5");
  CHECK(std::abs(changes[1].time_s - 1.42) < 1e-9);
  const auto braking = changes_along("plant.friction_profile", "braking distance: 1; 0.5 at 4");
  REQUIRE(braking.size() == 1);
  CHECK(std::abs(braking[0].time_s - 1.42) < 1e-9);
}

TEST_CASE("Unknown changes are left out") {
  CHECK(changes_along("plant.friction_profile", "distance: 1; 0.5 at 4", false).empty());
  CHECK(changes_along("plant.friction_profile", "no profile at all").empty());
  CHECK(changes_along("plant.friction_profile", "").empty());
}

}  // namespace
}  // namespace abs_hil::report
