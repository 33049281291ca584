// What the runs of a study are made of.
#include "study/study.hpp"

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "study/compute.hpp"
#include "study/paper_plan.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using Catch::Matchers::Contains;

namespace {

Study study_of_text(const std::string& text) {
  StudyScript script = parse_study(text, "test.toml");
  std::vector<StudyCase> cases;
  for (const std::string& plant : script.plants) {
    config::Settings settings = study::test::paper_settings();
    if (plant == "heavy") settings.plant.rig.wheels.J1_kg_m2 *= 2.0;
    cases.push_back({.plant = plant, .experiment = "paper", .settings = settings});
  }
  return {std::move(script), std::move(cases)};
}

constexpr const char* mixed = R"(
plants = ["light", "heavy"]
controllers = ["adaptive", "soft=adaptive{gamma=20}"]
[repeat]
runs = 3
[design]
kind = "random"
points = 5
[factors]
plant.theta_N = { from = 10, to = 30 }
control.slip_ref = [0.1, 0.2]
plant.B = { mean = 20, sd = 1 }
control.adaptive.ka1 = { from = 1, to = 2, steps = 3 }
)";

}  // namespace

TEST_CASE("every combination of plant, levels, point, repetition and controller is one run") {
  const Study study = study_of_text(mixed);
  REQUIRE(study.runs() == 2 * 2 * 3 * 5 * 3 * 2);
  std::set<std::tuple<std::size_t, double, double, std::uint64_t, std::uint64_t, std::size_t>> seen;
  for (std::uint64_t run = 0; run < study.runs(); ++run) {
    const RunIndex index = study.index_of(run);
    seen.emplace(index.study_case, std::get<double>(study.value_of(index, 1)),
                 std::get<double>(study.value_of(index, 3)), index.point, index.repetition, index.contender);
  }
  CHECK(seen.size() == study.runs());
  CHECK(study.index_of(1).contender == 1);
  CHECK(study.index_of(2).repetition == 1);
  CHECK(study.index_of(6).point == 1);
  CHECK(std::get<double>(study.value_of(study.index_of(30), 3)) == 1.5);  // the last factor's levels change first
  CHECK(std::get<double>(study.value_of(study.index_of(90), 1)) == 0.2);
}

TEST_CASE("controllers, levels and plants meet the same points and the same varied plants") {
  const Study study = study_of_text(mixed);
  RunSettings runs(study);
  std::map<std::pair<std::uint64_t, std::uint64_t>, std::set<std::pair<double, std::uint64_t>>> by_point;
  for (std::uint64_t run = 0; run < study.runs(); ++run) {
    const RunIndex index = study.index_of(run);
    const RunSettings::Drawn drawn = runs.drawn(index);
    const double theta_N = drawn.plant.rig.tyre.theta_N;
    by_point[{index.point, index.repetition}].emplace(theta_N, drawn.seed);
  }
  CHECK(by_point.size() == 15);
  for (const auto& [point, drawn] : by_point) CHECK(drawn.size() == 1);
}

TEST_CASE("a run's settings do not depend on the runs before it") {
  const Study study = study_of_text(mixed);
  RunSettings forward(study);
  std::vector<config::Settings> settings;
  for (std::uint64_t run = 0; run < study.runs(); ++run) settings.push_back(forward.of(study.index_of(run)));
  for (std::uint64_t run = study.runs(); run-- > 0;) {
    RunSettings alone(study);
    config::Settings one = alone.of(study.index_of(run));
    CHECK(config::KeyTable(one).to_json() == config::KeyTable(settings[run]).to_json());
  }
  CHECK(settings[0].control.adaptive.gamma != settings[1].control.adaptive.gamma);
  CHECK(settings[1].control.adaptive.gamma == 20.0);
}

TEST_CASE("every run that a part computes is the run of its own settings, wherever the part begins") {
  const Study study = study_of_text(R"(
controllers = ["adaptive", "pi"]
[settings]
experiment.end_speed_m_s = 12.0
[repeat]
runs = 2
[factors]
plant.theta_N = [18, 25]
control.slip_ref = [0.1, 0.15]
)");
  RunSettings settings(study);
  for (const std::uint64_t first : {0U, 3U, 7U}) {
    std::vector<Outcome> outcomes(study.runs() - first);
    run_part(
        study, outcomes.size(), 2, [first](std::size_t i) { return first + i; },
        [&outcomes](std::size_t i, Outcome outcome) { outcomes[i] = std::move(outcome); });
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      INFO("run " << first + i << " of a part from run " << first);
      const config::Settings alone = settings.whole(study.index_of(first + i));
      const RunResult expected = simulate(alone, alone.plant, config::sensor_seed(alone));
      REQUIRE(outcomes[i].refusal.empty());
      CHECK(outcomes[i].run.fault == expected.fault);
      CHECK(outcomes[i].run.metrics.stop_distance_m == expected.metrics.stop_distance_m);
      CHECK(outcomes[i].run.metrics.torque_total_variation_Nm == expected.metrics.torque_total_variation_Nm);
    }
  }
}

TEST_CASE("the model stays nominal unless it is asked to follow the factors") {
  const std::string factor = "[factors]\nplant.theta_N = [10, 40]\n";
  {
    const Study study = study_of_text(factor);
    RunSettings runs(study);
    CHECK(runs.of(study.index_of(1)).model.tyre.theta_N == 23.0);
    CHECK(runs.drawn(study.index_of(1)).plant.rig.tyre.theta_N == 40.0);
  }
  const Study study = study_of_text("model_follows = \"factors\"\n" + factor);
  RunSettings runs(study);
  CHECK(runs.of(study.index_of(1)).model.tyre.theta_N == 40.0);
  CHECK(runs.of(study.index_of(0)).model.tyre.theta_N == 10.0);
  CHECK_FALSE(study.shares_settings());
}

TEST_CASE("a model value that is a factor itself, or set, does not follow the plant's") {
  const Study study = study_of_text(
      "model_follows = \"factors\"\ncontrollers = [\"adaptive{model.B=9}\"]\n[factors]\nplant.theta_N = [10, 40]\n"
      "model.theta_N = [11]\nplant.B = [20]\n");
  RunSettings runs(study);
  const config::Settings& settings = runs.of(study.index_of(1));
  CHECK(settings.plant.rig.tyre.theta_N == 40.0);
  CHECK(settings.model.tyre.theta_N == 11.0);
  CHECK(settings.plant.rig.tyre.B == 20.0);
  CHECK(settings.model.tyre.B == 9.0);
}

TEST_CASE("settings are shared only while nothing but numbers of the plant differs") {
  CHECK(study_of_text("").shares_settings());
  CHECK(study_of_text("[factors]\nplant.B = [20, 21]\n").shares_settings());
  CHECK_FALSE(study_of_text("[factors]\nplant.B = [20, 21]\ncontrol.slip_ref = [0.1]\n").shares_settings());
  CHECK_FALSE(study_of_text("[factors]\nplant.ideal_sensors = [true, false]\n").shares_settings());
}

TEST_CASE("what a study cannot use is refused before any run") {
  CHECK_THROWS_WITH(study_of_text("controllers = [\"adaptive\", \"adaptive\"]"), Contains("given twice"));
  CHECK_THROWS_WITH(study_of_text("controllers = [\"adaptiv\"]"), Contains("adaptiv"));
  CHECK_THROWS_WITH(study_of_text("[repeat]\nruns = 1000000000\n[design]\nkind=\"random\"\npoints=10000000000\n"
                                  "[factors]\nplant.B = { from = 20, to = 21 }"),
                    Contains("1e+19 runs") && Contains("test.toml"));
}
