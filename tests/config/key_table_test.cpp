// The table of configuration keys: setting values by name, and what is refused.
#include "config/key_table.hpp"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "catch.hpp"
#include "config/config_error.hpp"

using namespace abs_hil::config;
using Catch::Matchers::Contains;

namespace {

struct Fixture {
  Settings settings;
  KeyTable table{settings};
};

std::string error_of(KeyTable& table, const std::string& assignment) {
  try {
    table.set_text(assignment, "--set");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("values are set by dotted name") {
  Fixture f;
  f.table.set_text("plant.theta_N=30", "--set");
  f.table.set_text("control.adaptive.ka1=2.5", "--set");
  f.table.set_text("plant.ideal_sensors=true", "--set");
  f.table.set_text("control.controller=nominal", "--set");
  f.table.set_text("plant.encoder_counts_per_rev=1024", "--set");
  CHECK(f.settings.plant.rig.tyre.theta_N == 30.0);
  CHECK(f.settings.control.adaptive.ka1 == 2.5);
  CHECK(f.settings.plant.ideal_sensors);
  CHECK(f.settings.control.controller == "nominal");
  CHECK(f.settings.plant.rig.encoder_counts_per_rev == 1024);
}

TEST_CASE("an unknown key names the nearest known one") {
  Fixture f;
  CHECK_THAT(error_of(f.table, "plant.thetaN=3"), Contains("unknown key plant.thetaN") && Contains("plant.theta_N"));
}

TEST_CASE("a part of a key's name gives the keys that contain it") {
  Fixture f;
  CHECK_THAT(error_of(f.table, "slip_ref=0.1"), Contains("the nearest known key is control.slip_ref ("));
  CHECK_THAT(error_of(f.table, "ka1=2"),
             Contains("the nearest known key is control.adaptive.ka1 or control.adaptive_actuator.ka1 ("));
  CHECK_THAT(error_of(f.table, "pi.kp=2"), Contains("the nearest known key is control.pi.kp_per_s ("));
  CHECK_THAT(error_of(f.table, "adaptive.gama=2"), Contains("the nearest known key is control.adaptive.gamma ("));
}

TEST_CASE("a bad value names key, value, range and unit, and changes nothing") {
  Fixture f;
  const std::string error = error_of(f.table, "plant.theta_N=-5");
  CHECK_THAT(error, Contains("plant.theta_N = -5") && Contains("(0, 100000]") && Contains(" N "));
  CHECK(error.find('\n') == std::string::npos);
  CHECK(f.settings.plant.rig.tyre.theta_N == 23.0);
}

TEST_CASE("values that are not a number, whole, finite, a flag or a known name are refused") {
  Fixture f;
  for (const char* bad :
       {"plant.theta_N=abc", "plant.theta_N=nan", "plant.theta_N=inf", "plant.theta_N=", "plant.theta_N=3x",
        "plant.theta_N=true", "plant.encoder_counts_per_rev=10.5", "plant.ideal_sensors=1", "control.controller=nope",
        "control.slip_ref=1", "control.slip_ref=0", "control.rate_Hz=0", "run.seed=-1", "plant.theta_N", "=3"}) {
    INFO(bad);
    CHECK_FALSE(error_of(f.table, bad).empty());
  }
}

TEST_CASE("every default lies within its own range, every key has a meaning, no two rows give the same key") {
  Fixture f;
  std::set<std::string_view> names;
  for (const Key& key : f.table.keys()) {
    INFO(key.name);
    CHECK(names.insert(key.name).second);
    CHECK_FALSE(key.meaning.empty());
    std::visit(
        [&key](const auto* target) {
          using Target = std::decay_t<decltype(*target)>;
          if constexpr (std::is_same_v<Target, std::string>) {
            CHECK(key.allowed.contains(*target));
          } else if constexpr (!std::is_same_v<Target, bool>) {
            CHECK(key.range.contains(static_cast<double>(*target)));
          }
        },
        key.target);
  }
}

TEST_CASE("only numbers have a search range, and it lies within their own range") {
  Fixture f;
  int searched = 0;
  for (const Key& key : f.table.keys()) {
    if (!key.search.given()) continue;
    INFO(key.name);
    ++searched;
    CHECK(std::holds_alternative<double*>(key.target));
    CHECK(key.range.contains(key.search.least));
    CHECK(key.range.contains(key.search.most));
    if (key.search.logarithmic) CHECK(key.search.least > 0.0);
  }
  CHECK(searched > 0);
}

TEST_CASE("groups have the order of recorded configurations") {
  Fixture f;
  const nlohmann::ordered_json json = f.table.to_json();
  std::vector<std::string> tables, controllers;
  for (const auto& item : json.items()) tables.push_back(item.key());
  for (const auto& item : json["control"].items()) controllers.push_back(item.key());
  CHECK(tables == std::vector<std::string>{"plant", "control", "experiment", "driver", "guardian", "commands", "gate",
                                           "realtime", "telemetry", "unsafe", "run"});
  CHECK(controllers == std::vector<std::string>{"controller",
                                                "rate_Hz",
                                                "slip_ref",
                                                "v_min_m_s",
                                                "adaptive",
                                                "nominal",
                                                "observer",
                                                "sliding_mode",
                                                "sliding_mode_smooth",
                                                "super_twisting",
                                                "relay",
                                                "pi",
                                                "five_phase",
                                                "adaptive_actuator",
                                                "adaptive_peak",
                                                "adaptive_optimal",
                                                "mixed_slip_deceleration",
                                                "braking_stiffness",
                                                "sliding_mode_actuator",
                                                "foreign"});
}

TEST_CASE("options that act only when braking begins are marked as start values") {
  Fixture f;
  std::set<std::string> marked;
  for (const Key& key : f.table.keys()) {
    if (key.start_value) marked.insert(key.name);
  }
  CHECK(marked == std::set<std::string>{"control.adaptive.zeta0", "control.adaptive_actuator.zeta0",
                                        "control.sliding_mode.theta0_N", "control.sliding_mode_actuator.theta0_N",
                                        "control.sliding_mode_smooth.theta0_N", "control.super_twisting.theta0_N"});
}

TEST_CASE("the names that scripts rely on exist") {
  Fixture f;
  std::set<std::string_view> names;
  for (const Key& key : f.table.keys()) names.insert(key.name);
  for (const char* name :
       {"plant.theta_N", "plant.B", "plant.C", "plant.ideal_actuator", "plant.encoder_counts_per_rev",
        "plant.ideal_sensors", "control.slip_ref", "control.adaptive.gamma", "control.adaptive.ks0",
        "control.adaptive.ks1", "control.adaptive.ka1", "control.adaptive.zeta0", "control.rate_Hz",
        "experiment.start_speed_rad_s", "experiment.end_speed_m_s"}) {
    INFO(name);
    CHECK(names.count(name) == 1);
  }
}

TEST_CASE("the effective configuration is nested like a file and complete") {
  Fixture f;
  f.table.set_text("control.adaptive.ka1=2.5", "--set");
  const nlohmann::ordered_json json = f.table.to_json();
  CHECK(json["control"]["adaptive"]["ka1"] == 2.5);
  CHECK(json["plant"]["encoder_counts_per_rev"] == 4096);
  std::size_t leaves = 0;
  const nlohmann::ordered_json flat = json.flatten();
  for (const auto& item : flat.items()) leaves += item.value().is_primitive() ? 1 : 0;
  // The values of the model are the plant's, and without a board the plant is the identity.
  const auto& keys = f.table.keys();
  CHECK(static_cast<std::ptrdiff_t>(leaves) == std::count_if(keys.begin(), keys.end(), [](const Key& key) {
          return !key.name.starts_with("model.") && !key.name.starts_with("rig.");
        }));
}

TEST_CASE("the effective configuration as TOML has every table once and every value unchanged") {
  Fixture f;
  f.table.set("telemetry.channel_prefix", std::string("with \"quotes\" and \\"), "test");
  f.table.set("plant.theta_N", 0.1 + 0.2, "test");
  const std::string text = f.table.to_toml();
  CHECK_THAT(text, Contains("channel_prefix = \"with \\\"quotes\\\" and \\\\\""));
  CHECK_THAT(text, Contains("theta_N = 0.30000000000000004\n"));
  CHECK(text.find("[control]\n") == text.rfind("[control]\n"));
}
