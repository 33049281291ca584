// The experiment slip-sweep finds the tyre's curve and its peak.
#include <cmath>
#include <nlohmann/json.hpp>

#include "abs_hil/rig/tyre_curve.hpp"
#include "analysis/friction_curve.hpp"
#include "catch.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::WithinRel;

namespace {

analysis::FrictionCurveResult swept(const Setup& setup) {
  const Result result = simulated(setup);
  REQUIRE(result.outcome.completed());
  analysis::FrictionCurve curve(setup.plant.rig.wheels, setup.plant.rig.encoder_counts_per_rev);
  for (rig::CycleRecord record : result.records) {
    // Keep only the encoders: remove the simulator's truth and the controller's estimates.
    record.truth = {};
    record.control = {};
    curve.consume(record, 0.0);
  }
  return curve.result();
}

Setup sweep(std::uint64_t seed) {
  Setup setup;
  setup.experiment.name = "slip-sweep";
  setup.seed = seed;
  return setup;
}

}  // namespace

TEST_CASE("slip-sweep finds the plant's peak force within 2 % and its slip within 10 %, from encoder counts alone") {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Setup setup = sweep(seed);
    const auto curve = swept(setup);
    CHECK_THAT(curve.peak_force_N, WithinRel(setup.plant.rig.tyre.theta_N, 0.02));
    CHECK_THAT(curve.peak_slip, WithinRel(rig::peak_slip(setup.plant.rig.tyre), 0.10));
  }
}

TEST_CASE("slip-sweep finds another plant's peak, though the controller has the first plant's parameters") {
  Setup setup = sweep(1);
  setup.plant.rig.tyre.theta_N = 18.0;
  setup.plant.rig.tyre.B = 20.0;
  const auto curve = swept(setup);
  CHECK_THAT(curve.peak_force_N, WithinRel(18.0, 0.02));
  CHECK_THAT(curve.peak_slip, WithinRel(rig::peak_slip(setup.plant.rig.tyre), 0.10));
}

TEST_CASE("the traced curve lies on the plant's") {
  const Setup setup = sweep(1);
  const auto curve = swept(setup);
  double square_sum = 0.0;
  int n = 0;
  for (const auto& point : curve.points) {
    if (point.slip < 0.02) continue;  // while the brake sets in, force and slip change within the window
    const double plant_N = setup.plant.rig.tyre.theta_N * rig::normalised_tyre_force(setup.plant.rig.tyre, point.slip);
    square_sum += (point.force_N - plant_N) * (point.force_N - plant_N);
    ++n;
  }
  REQUIRE(n > 500);
  CHECK(std::sqrt(square_sum / n) < 0.02 * setup.plant.rig.tyre.theta_N);
}

TEST_CASE("a run that never passes the peak has none") {
  analysis::FrictionCurve curve({}, 4096);
  CHECK(std::isnan(curve.result().peak_force_N));
  for (int i = 0; i < 500; ++i) {
    rig::CycleRecord record;
    record.phase = rig::Phase::brake;
    record.measurement = {.time_ns = i * 1'000'000, .upper_counts = 60 * i, .lower_counts = 60 * i};
    curve.consume(record, 0.0);
  }
  CHECK(std::isnan(curve.result().peak_force_N));
  CHECK(analysis::to_json(curve.result())["peak_slip"].is_null());
}
