// The counters of the simulated rig: their phase, wrap and true angles.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "catch.hpp"
#include "driver/sim/sim_driver.hpp"
#include "rig/encoder_scale.hpp"

using namespace abs_hil::driver;
using abs_hil::plant_sim::PlantOptions;
using abs_hil::rig::Measurement;

namespace {

constexpr std::int64_t ms = 1'000'000;

std::vector<Measurement> coasting(const PlantOptions& plant, const SimStart& start, int ticks) {
  SimDriver driver(plant, start);
  driver.configure();
  driver.activate(0);
  std::vector<Measurement> readings;
  for (int tick = 0; tick <= ticks; ++tick) {
    Measurement measurement;
    REQUIRE(driver.read(tick * ms, measurement).ok());
    readings.push_back(measurement);
  }
  return readings;
}

}  // namespace

TEST_CASE("Counters start at 0 and follow the true angles to a count") {
  SimDriver driver({}, {.seed = 3, .start_speed_rad_s = 120.0});
  driver.configure();
  driver.activate(77);
  Measurement measurement;
  REQUIRE(driver.read(77, measurement).ok());
  CHECK(measurement.time_ns == 77);
  CHECK(measurement.upper_counts == 0);
  CHECK(measurement.lower_counts == 0);
  for (int tick = 1; tick <= 500; ++tick) {
    REQUIRE(driver.read(77 + tick * ms, measurement).ok());
    const double upper = driver.plant().state().angle1_rad * 4096.0 / (2.0 * std::numbers::pi);
    const double lower = driver.plant().state().angle2_rad * 4096.0 / (2.0 * std::numbers::pi);
    REQUIRE(std::abs(measurement.upper_counts - upper) < 1.0);
    REQUIRE(std::abs(measurement.lower_counts - lower) < 1.0);
  }
  CHECK(measurement.upper_counts > 30000);
}

TEST_CASE("The seed sets the phase within a count: the same gives the same counts, another less than a count off") {
  const std::vector<Measurement> one = coasting({}, {.seed = 1, .start_speed_rad_s = 90.0}, 1000);
  const std::vector<Measurement> same = coasting({}, {.seed = 1, .start_speed_rad_s = 90.0}, 1000);
  const std::vector<Measurement> other = coasting({}, {.seed = 2, .start_speed_rad_s = 90.0}, 1000);
  int differing_upper = 0;
  int differing_lower = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    REQUIRE(same[i].upper_counts == one[i].upper_counts);
    REQUIRE(same[i].lower_counts == one[i].lower_counts);
    REQUIRE(std::abs(other[i].upper_counts - one[i].upper_counts) <= 1);
    REQUIRE(std::abs(other[i].lower_counts - one[i].lower_counts) <= 1);
    differing_upper += other[i].upper_counts != one[i].upper_counts;
    differing_lower += other[i].lower_counts != one[i].lower_counts;
  }
  CHECK(differing_upper > 0);
  CHECK(differing_upper < 1000);
  CHECK(differing_lower > 0);
  CHECK(differing_lower < 1000);
}

TEST_CASE("The counters wrap at 32 bits, and differences are right across the wrap") {
  // The finest encoder, under full drive: the upper wheel needs 2^31 counts, 2,147 turns, which take about 70 s.
  constexpr int counts_per_rev = 1'000'000;
  PlantOptions plant;
  plant.rig.encoder_counts_per_rev = counts_per_rev;
  SimDriver driver(plant, {.start_speed_rad_s = 170.0});
  driver.configure();
  driver.activate(0);
  Measurement before;
  REQUIRE(driver.read(0, before).ok());
  std::int64_t upper_total = 0;
  bool wrapped = false;
  for (int tick = 1; tick <= 90'000; ++tick) {
    Measurement now;
    REQUIRE(driver.write({.motor_duty = 1.0, .motor_enable = true}).ok());
    REQUIRE(driver.read(tick * ms, now).ok());
    wrapped = wrapped || now.upper_counts < before.upper_counts;
    upper_total += abs_hil::rig::counts_between(before.upper_counts, now.upper_counts);
    before = now;
  }
  const double true_counts =
      driver.plant().state().angle1_rad * static_cast<double>(counts_per_rev) / (2.0 * std::numbers::pi);
  CHECK(wrapped);
  CHECK(std::abs(static_cast<double>(upper_total) - true_counts) < 1.0);
}

TEST_CASE("Only ideal sensors carry the true speeds") {
  CHECK_FALSE(coasting({}, {.start_speed_rad_s = 90.0}, 3).back().ideal_speeds.has_value());
  SimDriver driver({.ideal_sensors = true}, {.start_speed_rad_s = 90.0});
  driver.configure();
  driver.activate(0);
  Measurement measurement;
  REQUIRE(driver.read(20 * ms, measurement).ok());
  REQUIRE(measurement.ideal_speeds.has_value());
  CHECK(measurement.ideal_speeds->omega1_rad_s == driver.truth().speeds.omega1_rad_s);
  CHECK(measurement.ideal_speeds->omega2_rad_s == driver.truth().speeds.omega2_rad_s);
  CHECK(measurement.ideal_speeds->omega1_rad_s < 90.0);
}

TEST_CASE("Values that a board cannot measure are NaN") {
  const Measurement measurement = coasting({}, {}, 1).back();
  CHECK(std::isnan(measurement.supply_V));
  CHECK(std::isnan(measurement.temperature_C));
  CHECK(measurement.trip_flags == 0U);
}
