// The model that controllers believe in, apart from the simulated plant.

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/merge.hpp"
#include "config/plan.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil::config;
using Catch::Matchers::Contains;

namespace {

struct Fixture {
  Settings settings;
  KeyTable table{settings};

  void set(std::initializer_list<const char*> assignments) {
    for (const char* assignment : assignments) table.set_text(assignment, "--set");
  }
};

std::string error_of(KeyTable& table, const std::string& assignment) {
  try {
    table.set_text(assignment, "--set");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

class File {
 public:
  explicit File(const std::string& text) { std::ofstream(path_) << text; }
  [[nodiscard]] std::filesystem::path path() const { return path_; }

 private:
  abs_hil::test::TemporaryFolder folder_;
  std::filesystem::path path_{folder_ / "mine.toml"};
};

}  // namespace

TEST_CASE("each value of the rig is a value of plant and model") {
  Fixture f;
  std::size_t of_model = 0;
  for (const Key& key : f.table.keys()) {
    if (!key.name.starts_with("model.")) continue;
    ++of_model;
    const auto& keys = f.table.keys();
    CHECK(std::any_of(keys.begin(), keys.end(), [&](const Key& plant) {
      return plant.name == "plant." + key.name.substr(6) && model_key(keys, plant.name) == &key;
    }));
  }
  CHECK(of_model == 29);
  CHECK(model_key(f.table.keys(), "plant.ideal_actuator") == nullptr);
  CHECK(model_key(f.table.keys(), "control.slip_ref") == nullptr);
}

TEST_CASE("a value of the model that nobody sets is the plant's") {
  Fixture f;
  f.set({"plant.theta_N=40", "plant.encoder_counts_per_rev=1024"});
  CHECK(f.settings.model == f.settings.plant.rig);
  f.set({"plant.theta_N=41"});
  CHECK(f.settings.model.tyre.theta_N == 41.0);
  CHECK(in_words(model_differences(f.settings)).empty());
}

TEST_CASE("plant and model part, whichever is set first") {
  const bool model_first = GENERATE(true, false);
  Fixture f;
  if (model_first) {
    f.set({"model.theta_N=23", "plant.theta_N=40"});
  } else {
    f.set({"plant.theta_N=40", "model.theta_N=23"});
  }
  CHECK(f.settings.plant.rig.tyre.theta_N == 40.0);
  CHECK(f.settings.model.tyre.theta_N == 23.0);
  f.set({"plant.theta_N=50"});
  CHECK(f.settings.model.tyre.theta_N == 23.0);
  CHECK(in_words(model_differences(f.settings)) == "theta_N 23 (plant 50)");
  f.set({"model.C=1.5"});
  CHECK_THAT(in_words(model_differences(f.settings)), Contains("theta_N 23 (plant 50), ") && Contains("C 1.5 (plant "));
}

TEST_CASE(
    "the effective configuration holds the values of the model that were set, and reads back to the same meaning") {
  Fixture f;
  CHECK_FALSE(f.table.to_json().contains("model"));
  CHECK_THAT(f.table.to_toml(), !Contains("[model]"));
  f.set({"plant.J1_kg_m2=0.009", "model.theta_N=30", "model.B=28"});
  const nlohmann::ordered_json json = f.table.to_json();
  CHECK(json["model"] == nlohmann::ordered_json{{"theta_N", 30.0}, {"B", 28.0}});

  Fixture from_json, from_toml;
  CHECK(load_json(json, from_json.table, "json").empty());
  const File file(f.table.to_toml());
  load_file(file.path(), from_toml.table);
  for (Fixture* read : {&from_json, &from_toml}) {
    CHECK(read->settings.model == f.settings.model);
    read->set({"plant.theta_N=40", "plant.B=20", "plant.C=1.5"});
    CHECK(read->settings.model.tyre.theta_N == 30.0);
    CHECK(read->settings.model.tyre.B == 28.0);  // set, although to the plant's value of then
    CHECK(read->settings.model.tyre.C == 1.5);
  }
}

TEST_CASE("a configuration of a version without model has the plant as its model") {
  Fixture f;
  CHECK(load_json(nlohmann::ordered_json::parse(R"({"plant":{"theta_N":40}})"), f.table, "old").empty());
  CHECK(f.settings.model.tyre.theta_N == 40.0);
}

TEST_CASE("settings whose model differs keep it in a table made later") {
  Settings settings;
  settings.model.brake.c31_per_s = 16.0;
  KeyTable table(settings);
  CHECK(table.was_set("model.c31_per_s"));
  CHECK_FALSE(table.was_set("model.theta_N"));
  table.set_text("plant.c31_per_s=30", "--set");
  CHECK(settings.model.brake.c31_per_s == 16.0);
  CHECK(table.to_json()["model"] == nlohmann::ordered_json{{"c31_per_s", 16.0}});
}

TEST_CASE("on a rig only the model exists") {
  Fixture f;
  f.table.leave_out_plant();
  CHECK_THAT(error_of(f.table, "plant.theta_N=30"), Contains("plant.theta_N") && Contains("set model.theta_N"));
  CHECK_THAT(error_of(f.table, "plant.tyre=inteco-mu"), Contains("plant.tyre") && Contains("--backend sim"));
  CHECK_THAT(error_of(f.table, "plant.thetaN=30"), Contains("unknown key") && Contains("model.theta_N"));
  f.set({"model.r2_m=0.1"});
  CHECK(f.settings.plant.rig.wheels.r2_m == 0.1);  // for $plant.r2_m in a script
  const nlohmann::ordered_json json = f.table.to_json();
  CHECK_FALSE(json.contains("plant"));
  CHECK(json["model"].size() == 29);
  CHECK(json["model"]["r2_m"] == 0.1);
  CHECK_THAT(f.table.to_toml(), !Contains("[plant]") && Contains("[model]"));
}

TEST_CASE("the plant's table of a file is a rig's model; its own model takes precedence") {
  const File file("[plant]\ntheta_N = 30\nB = 20\ntyre = \"inteco-mu\"\nfriction_profile = \"\"\n[model]\nB = 25\n");
  const std::vector<FileValue> values = read_model(file.path());
  Fixture f;
  f.table.leave_out_plant();
  set_all(values, f.table);
  CHECK(f.settings.model.tyre.theta_N == 30.0);
  CHECK(f.settings.model.tyre.B == 25.0);

  const File profile("[plant]\nfriction_profile = \"time: 0.5\"\n");
  CHECK_THROWS_WITH(read_model(profile.path()), Contains("plant.friction_profile") && Contains(":2"));
  const File misspelt("[plant]\nthetaN = 3\n");
  CHECK_THROWS_WITH(set_all(read_model(misspelt.path()), f.table), Contains("unknown key plant.thetaN"));
}

TEST_CASE("a plant's file is a whole model; a table model gives only its own values") {
  Fixture f;
  f.set({"plant.theta_N=40", "plant.C=1.5"});
  const File plant("[plant]\nJ1_kg_m2 = 0.006\ntyre = \"inteco-mu\"\n");
  set_all(read_model(plant.path()), f.table);
  CHECK(f.settings.model.wheels.J1_kg_m2 == 0.006);
  CHECK(f.settings.model.tyre.theta_N == 23.0);  // the default
  CHECK(f.settings.plant.rig.tyre.theta_N == 40.0);
  CHECK(f.settings.plant.tyre == "magic-formula");

  Fixture g;
  const File model("[model]\nJ1_kg_m2 = 0.006\n");
  set_all(read_model(model.path()), g.table);
  g.set({"plant.theta_N=40"});
  CHECK(g.settings.model.tyre.theta_N == 40.0);
  CHECK(g.settings.model.wheels.J1_kg_m2 == 0.006);
}

TEST_CASE("a plant's file may hold a model, and nothing else") {
  const File file("[plant]\ntheta_N = 40\n[model]\ntheta_N = 23\n");
  Fixture f;
  load_file(file.path(), f.table, Tables::of_plant);
  CHECK(f.settings.plant.rig.tyre.theta_N == 40.0);
  CHECK(f.settings.model.tyre.theta_N == 23.0);
}

TEST_CASE("a theta outside the bounds of the estimate is named") {
  Fixture f;
  CHECK(theta_out_of_bounds(f.settings).empty());
  f.set({"plant.theta_N=300"});
  REQUIRE(theta_out_of_bounds(f.settings).size() == 1);
  CHECK_THAT(theta_out_of_bounds(f.settings)[0],
             Contains("plant.theta_N = 300") && Contains("[0, 100]") && Contains("control.adaptive.theta_max_N"));
  f.set({"model.theta_N=23", "control.adaptive.theta_min_N=25"});
  REQUIRE(theta_out_of_bounds(f.settings).size() == 2);
  CHECK_THAT(theta_out_of_bounds(f.settings)[1], Contains("model.theta_N = 23"));
  f.set({"control.controller=pi"});  // it estimates nothing
  CHECK(theta_out_of_bounds(f.settings).empty());

  Fixture rig;
  rig.settings.backend = "rig";
  rig.set({"model.theta_N=300"});
  REQUIRE(theta_out_of_bounds(rig.settings).size() == 1);
  CHECK_THAT(theta_out_of_bounds(rig.settings)[0], Contains("model.theta_N = 300"));
}

TEST_CASE("a cap of the brake that keeps the wheel from the wanted slip is named") {
  const Script braking = parse(
      "[[phase]]\nname = \"brake\"\nbrake = \"controller\"\nuntil = { standstill = true }\n"
      "at_most_s = 9\n",
      "mine.toml", {});
  Fixture f;
  CHECK(slip_out_of_reach(braking, f.settings).empty());  // the whole brake
  f.set({"gate.brake_duty_max=0.7"});
  CHECK(slip_out_of_reach(braking, f.settings).empty());  // 4.46 N m, and Table 1's tyre takes 2.95 N m
  f.set({"plant.theta_N=47"});
  CHECK_THAT(slip_out_of_reach(braking, f.settings),
             Contains("gate.brake_duty_max = 0.7") && Contains("at most 4.46 N m") && Contains("takes 6 N m") &&
                 Contains("plant.theta_N = 47 N") && Contains("below about 0.019"));
  // A slip below that is within reach; past the peak the torque of the peak has to be passed.
  f.set({"control.slip_ref=0.018"});
  CHECK(slip_out_of_reach(braking, f.settings).empty());
  f.set({"control.slip_ref=0.9"});
  CHECK_THAT(slip_out_of_reach(braking, f.settings), Contains("takes 6 N m"));
  // Without a phase that controls slip there is none to reach.
  CHECK(slip_out_of_reach(*find("coast-down"), f.settings).empty());

  Fixture rig;
  rig.settings.backend = "rig";
  rig.set({"gate.brake_duty_max=0.7", "model.theta_N=47"});
  CHECK_THAT(slip_out_of_reach(braking, rig.settings), Contains("model.theta_N = 47 N"));
}

TEST_CASE("a brake map that is negative at the end of its dead zone is named with the duty that it needs") {
  Fixture f;
  CHECK(negative_at_dead_zone(f.settings).empty());
  f.set({"plant.u0=0.35", "plant.b1_Nm=15", "plant.b2_Nm=-6"});  // b(0.35) = -0.75; b(0.4) = 0
  REQUIRE(negative_at_dead_zone(f.settings).size() == 1);        // the model follows the plant
  CHECK_THAT(negative_at_dead_zone(f.settings)[0], Contains("plant.u0 = 0.35") && Contains("is -0.75 N m") &&
                                                       Contains("give plant.u0 = 0.4,") &&
                                                       Contains("plant.b1_Nm = 15") && Contains("plant.b2_Nm = -6"));
  f.set({"plant.u0=0.4"});  // what the message said
  CHECK(negative_at_dead_zone(f.settings).empty());
  f.set({"plant.b2_Nm=-20"});  // no duty brakes, and no u0 would mend it
  REQUIRE(negative_at_dead_zone(f.settings).size() == 1);
  CHECK_THAT(negative_at_dead_zone(f.settings)[0], Contains("plant.b2_Nm = -20") && !Contains("give plant.u0"));
  f.set({"plant.b2_Nm=-6", "model.u0=0.3", "plant.u0=0.2"});
  REQUIRE(negative_at_dead_zone(f.settings).size() == 2);
  CHECK_THAT(negative_at_dead_zone(f.settings)[1], Contains("model.u0 = 0.3"));

  Fixture rig;
  rig.settings.backend = "rig";
  rig.set({"model.u0=0.35", "plant.u0=0.1"});
  REQUIRE(negative_at_dead_zone(rig.settings).size() == 1);  // there is no simulated plant
  CHECK_THAT(negative_at_dead_zone(rig.settings)[0], Contains("model.u0 = 0.35"));
}

TEST_CASE("limits of a plan are judged by the model") {
  Fixture f;
  f.set({"experiment.name=paper", "model.b1_Nm=1"});
  Plan strong = plan(f.settings);
  for (auto& phase : strong.phases) {
    if (phase.brake == abs_hil::experiment::BrakeAction::torque) phase.brake_torque_Nm = 5.0;
  }
  CHECK_FALSE(beyond_limits(strong, f.settings).empty());
  f.set({"model.b1_Nm=15.24", "plant.b1_Nm=1"});
  CHECK(beyond_limits(strong, f.settings).empty());
}

TEST_CASE("which experiments mean to stop follows from their own conditions") {
  const auto stops = [](const std::string& phases) {
    return means_to_stop(plan(parse(phases, "mine.toml", {}), Settings{}), 0.5);
  };
  const std::string brake = "[[phase]]\nname = \"brake\"\nbrake = \"controller\"\n";
  const std::string below = "until = { car_speed_below_m_s = 0.5 }\nat_most_s = 9\n";
  const std::string lasts = "until = { lasts_s = 1 }\n";
  const std::string hold = "[[phase]]\nname = \"hold\"\nuntil = { standstill = true }\nat_most_s = 9\n";
  CHECK(stops(brake + below));
  CHECK_FALSE(stops(brake + "until = { car_speed_below_m_s = 0.6 }\nat_most_s = 9\n"));  // it ends while the car moves
  CHECK_FALSE(stops(brake + lasts));  // slip control's own least speed is not the script's condition
  CHECK(stops(brake + lasts + hold));
  CHECK_FALSE(stops(hold));
  CHECK_FALSE(stops(brake + "until.any = [{ lasts_s = 1 }, { car_speed_below_m_s = 0.5 }]\nat_most_s = 9\n"));
  for (const char* name : {"paper", "friction-jump", "slip-sweep", "brake-step"}) {
    Settings settings;
    settings.experiment.name = name;
    INFO(name);
    CHECK(means_to_stop(plan(settings), settings.experiment.end_speed_m_s));
  }
  Settings coast;
  coast.experiment.name = "coast-down";
  CHECK_FALSE(means_to_stop(plan(coast), coast.experiment.end_speed_m_s));
}

TEST_CASE("a model says when it was identified, and how long ago") {
  const File file("identified = 2026-11-22\n[plant]\ntheta_N = 25\n");
  Settings settings;
  settings.model_name = file.path().string();
  const std::chrono::sys_days today = std::chrono::year{2026} / 12 / 1;
  CHECK_THAT(model_origin(settings, today), Contains("identified on 2026-11-22, 9 days ago"));
  CHECK_NOTHROW(read_model(file.path()));
  settings.model_name.clear();
  settings.plant_name = "paper-table1";
  CHECK(model_origin(settings, today) ==
        "model paper-table1: not identified from the rig's own logs; abs_hil identify does that");
}
