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

}  // namespace

TEST_CASE("the search sets the gains of seven controllers, in an order on which its results depend") {
  const auto names_of = [](std::string_view controller) {
    std::string names;
    for (const TunedKey& tuned : tuned_keys(controller)) names += tuned.name + ' ';
    return names;
  };
  CHECK(tunable_controllers() == std::vector<std::string_view>{"adaptive", "sliding-mode", "sliding-mode-smooth",
                                                               "super-twisting", "pi", "relay", "five-phase"});
  CHECK(
      names_of("adaptive") ==
      "control.adaptive.gamma control.adaptive.ks0 control.adaptive.ks1 control.adaptive.ka1 control.adaptive.zeta0 ");
  CHECK(names_of("sliding-mode-smooth") ==
        "control.sliding_mode_smooth.gain_m_s2 control.sliding_mode_smooth.boundary_m_s "
        "control.sliding_mode_smooth.gamma control.sliding_mode_smooth.theta0_N ");
  CHECK(names_of("locked").empty());
  const rig::SearchRange gamma = tuned_keys("sliding-mode")[1].search;
  CHECK((gamma.least == 1.0 && gamma.most == 1000.0 && gamma.logarithmic));
  CHECK_FALSE(tuned_keys("adaptive").back().search.logarithmic);
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
    CHECK((found.values[d] >= keys[d].search.least && found.values[d] <= keys[d].search.most));
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
