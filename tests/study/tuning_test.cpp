#include "study/tuning.hpp"

#include <filesystem>
#include <fstream>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "paper_plan.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;

namespace {

TrainingSet small_training() { return {.plants = {test::paper_settings()}, .cases_per_plant = 1}; }

const config::Key* find_key(const config::KeyTable& table, std::string_view name) {
  for (const config::Key& key : table.keys()) {
    if (key.name == name) return &key;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("the tuned keys are configuration keys of existing controllers, within their ranges") {
  config::Settings settings;
  const config::KeyTable table(settings);
  for (const std::string_view controller : tunable_controllers()) {
    CHECK_NOTHROW(control::make_controller(controller, {settings.control, settings.plant.rig}));
    for (const TunedKey& tuned : tuned_keys(controller)) {
      INFO(tuned.name);
      const config::Key* key = find_key(table, tuned.name);
      REQUIRE(key != nullptr);
      CHECK(std::holds_alternative<double*>(key->target));
      CHECK(key->range.contains(tuned.least));
      CHECK(key->range.contains(tuned.most));
      CHECK(tuned.least < tuned.most);
      if (tuned.logarithmic) CHECK(tuned.least > 0.0);
    }
  }
}

TEST_CASE("the cost of a run is the sum stated in the docs") {
  RunResult run;
  run.metrics.stop_distance_m = 15.0;
  run.metrics.slip_rms = 0.01;
  run.metrics.slip_overshoot = 0.05;
  run.metrics.time_locked_s = 0.1;
  run.metrics.torque_total_variation_Nm = 900.0;
  CHECK_THAT(run_cost(run, true, 20.0, 9.0), WithinAbs(0.75 + 0.02 + 0.01 + 0.05 + 0.01, 1e-12));
  CHECK_THAT(run_cost(run, false, 20.0, 9.0), WithinAbs(0.75 + 0.05 + 0.01, 1e-12));
  run.fault = rig::Reason::overspeed;
  CHECK(run_cost(run, true, 20.0, 9.0) == 3.0);
  CHECK(run_cost({}, true, 20.0, 9.0) == 3.0);  // never stopped
}

TEST_CASE("the search improves on bad gains, with the same result for any number of threads") {
  TrainingSet training = small_training();
  training.plants[0].control.adaptive.ks1 = 4.0;
  training.plants[0].control.adaptive.gamma = 1.0;
  SearchOptions search{.generations = 3, .population = 8, .seed = 5, .threads = 1};
  const TuningResult found = tune("adaptive", training, search);
  CHECK(found.evaluations == 1 + 8 * 4);
  CHECK(found.cost < 0.98 * found.start_cost);
  search.threads = 3;
  const TuningResult again = tune("adaptive", training, search);
  CHECK(again.values == found.values);
  CHECK(again.cost == found.cost);
  training.plants[0].control.adaptive.ks1 = 32.0;  // the starting gains make no difference
  CHECK(tune("adaptive", training, search).values == found.values);
  search.seed = 6;
  CHECK(tune("adaptive", training, search).values != found.values);
}

TEST_CASE("the reported cost is that of the reported gains, which lie within their ranges") {
  const TrainingSet training = small_training();
  const TuningResult found = tune("adaptive", training, {.generations = 2, .population = 8});
  config::Settings tuned = training.plants[0];
  config::KeyTable table(tuned);
  const auto keys = tuned_keys("adaptive");
  for (std::size_t d = 0; d < keys.size(); ++d) {
    CHECK((found.values[d] >= keys[d].least && found.values[d] <= keys[d].most));
    table.set(keys[d].name, found.values[d], "test");
  }
  const TuningResult from_there = tune("adaptive", {.plants = {tuned}, .cases_per_plant = 1}, {.generations = 1});
  CHECK_THAT(from_there.start_cost, WithinAbs(found.cost, 1e-12));
}

TEST_CASE("the gains found are written as a configuration file that loads") {
  const TuningResult result{.values = {21, 0.5, 32.5, 1e-1, 0}, .cost = 0.7, .start_cost = 0.8, .evaluations = 40};
  const std::string text = to_toml("adaptive", result, "how");
  CHECK_THAT(text, Contains("# how\n") && Contains("[control.adaptive]\ngamma = 21.0\nks0 = 0.5\n"));
  const auto path = std::filesystem::temp_directory_path() / "abs_hil_tuning_test.toml";
  std::ofstream(path) << text;
  config::Settings settings;
  config::KeyTable table(settings);
  config::load_file(path, table);
  std::filesystem::remove(path);
  CHECK(settings.control.adaptive.ks1 == 32.5);
  CHECK(settings.control.adaptive.ka1 == 0.1);
}

TEST_CASE("a controller without gains and an empty training set are refused") {
  CHECK_THROWS_WITH(tune("locked", small_training(), {}), Contains("locked"));
  CHECK_THROWS_WITH(tune("adaptive", {}, {}), Contains("training set"));
}
