// Configuration files: every kind of value, and messages that name file and line.
#include "config/config_file.hpp"

#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "catch.hpp"
#include "config/config_error.hpp"

using namespace abs_hil::config;
using Catch::Matchers::Contains;

namespace {

/// A temporary file. The destructor removes it.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text)
      : path_(std::filesystem::temp_directory_path() / ("abs_hil_config_test_" + std::to_string(getpid()) + ".toml")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string load_error(const std::string& text, Tables tables = Tables::all) {
  const TemporaryFile file(text);
  Settings settings;
  KeyTable table(settings);
  try {
    load_file(file.path(), table, tables);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("a file sets values of every kind") {
  const TemporaryFile file(
      "description = \"x\"\n[plant]\ntheta_N = 30\nideal_sensors = true\n[control.adaptive]\nka1 = 0.5\n[control]\n"
      "controller = \"nominal\"\n");
  Settings settings;
  KeyTable table(settings);
  load_file(file.path(), table);
  CHECK(settings.plant.rig.tyre.theta_N == 30.0);
  CHECK(settings.plant.ideal_sensors);
  CHECK(settings.control.adaptive.ka1 == 0.5);
  CHECK(settings.control.controller == "nominal");
}

TEST_CASE("errors in a file name file and line") {
  CHECK_THAT(load_error("[plant]\n\nthetaN = 3\n"), Contains(".toml:3") && Contains("plant.theta_N"));
  CHECK_THAT(load_error("[plant]\ntheta_N = -3\n"), Contains(".toml:2") && Contains("(0, 100000]"));
  CHECK_THAT(load_error("[plant]\nx="), Contains(".toml:2") && Contains("not valid TOML"));
  CHECK_THAT(load_error("[plant]\ntheta_N = [1, 2]\n"), Contains("neither a number"));
  CHECK_THAT(load_error("[plant]\ntheta_N = nan\n"), Contains("theta_N"));
  CHECK_THAT(load_error("[plant]\n[contrl]\n"), Contains(".toml:2") && Contains("contrl"));
  CHECK(load_error("[control]\n[control.adaptive]\n").empty());
}

TEST_CASE("a plant file with another table is refused") {
  CHECK_THAT(load_error("[control]\nslip_ref = 0.1\n", Tables::of_plant), Contains(".toml:1") && Contains("[plant]"));
  CHECK(load_error("description = \"p\"\n[plant]\nB = 20\n", Tables::of_plant).empty());
}

TEST_CASE("a missing file is named") {
  Settings settings;
  KeyTable table(settings);
  CHECK_THROWS_WITH(load_file("/nonexistent.toml", table), Contains("/nonexistent.toml") && Contains("no such file"));
}

TEST_CASE("plants are found by name; an unknown one names the known") {
  CHECK(plant_file("paper-timing").filename() == "paper-timing.toml");
  CHECK(plant_file("some/where.toml") == "some/where.toml");
  CHECK_THROWS_WITH(plant_file("paper-table2"), Contains("the nearest is paper-table1"));
}

TEST_CASE("every shipped plant loads, sets every plant key and has a description") {
  const auto plants = known_plants();
  REQUIRE(plants.size() >= 2);
  for (const PlantEntry& plant : plants) {
    INFO(plant.name);
    CHECK_FALSE(plant.description.empty());
    Settings settings;
    KeyTable table(settings);
    CHECK_NOTHROW(load_file(plant_file(plant.name), table, Tables::of_plant));
  }
}

TEST_CASE("plant paper-table1 equals the defaults") {
  Settings defaults;
  Settings loaded;
  KeyTable table(loaded);
  load_file(plant_file("paper-table1"), table, Tables::of_plant);
  CHECK(table.to_json() == KeyTable(defaults).to_json());
}

TEST_CASE("the maker's plant has the manual's numbers, its models, and the fit for the controllers") {
  Settings settings;
  KeyTable table(settings);
  load_file(plant_file("inteco-manual"), table, Tables::of_plant);
  const auto& p = settings.plant;
  CHECK(p.tyre == "inteco-mu");
  CHECK(p.load == "lever");
  CHECK(p.inteco_mu.w1 == -0.04240011450454);
  CHECK(p.inteco_mu.w2 == 2.9375e-10);
  CHECK(p.inteco_mu.w3 == 0.03508217905067);
  CHECK(p.inteco_mu.w4 == 0.40662691102315);
  CHECK(p.inteco_mu.a == 0.00025724985785);
  CHECK(p.inteco_mu.p == 2.09945271667129);
  CHECK(p.lever.Mg_Nm == 19.62);
  CHECK(p.lever.L_m == 0.370);
  CHECK(p.lever.phi_deg == 65.61);
  CHECK(p.rig.wheels.J1_kg_m2 == 7.53e-3);
  CHECK(p.rig.wheels.d1_Nms_rad == 1.1874e-4);
  CHECK(p.rig.tyre.theta_N == 34.31);
  CHECK(p.rig.tyre.B == 19.49);
  CHECK(p.rig.tyre.C == 1.2694);
  CHECK(p.friction_profile.empty());
}
