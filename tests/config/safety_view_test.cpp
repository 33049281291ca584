// One rule judges all that a run may do on a board, by whatever route a number comes: option, file, study, the settings
// of an experiment, a run of its series, a phase.
#include <cmath>
#include <fstream>
#include <functional>
#include <stdexcept>

#include "catch.hpp"
#include "config/board_policy.hpp"
#include "config/merge.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

/// What refuses a run on a board from these sources; empty: nothing does.
std::string refusal(config::Sources sources, const std::string& consent = {}) {
  sources.backend = "rig";
  if (!consent.empty()) sources.assignments.push_back("unsafe.keys=" + consent);
  try {
    static_cast<void>(config::merge(sources));
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

struct Files {
  /// A file of its own each time: a process reads an experiment once.
  std::string made(const std::string& name, const std::string& text) const {
    const auto file = folder.path / (std::to_string(count++) + name);
    std::ofstream(file) << text;
    return file.string();
  }
  test::TemporaryFolder folder{};
  mutable int count{0};
};

constexpr const char* phases = "[[phase]]\nname = \"wait\"\nuntil = { lasts_s = 1 }\n";

/// An experiment with one phase of these lines.
std::string script(const std::string& lines) { return "description = \"x\"\n[[phase]]\nname = \"p\"\n" + lines + '\n'; }

/// A value of the key that weakens the protection, within its range; nothing for a key whose range has none.
std::optional<config::Value> weak_value(const config::Key& key) {
  using Kind = rig::SafetyClass::Kind;
  const rig::SafetyClass& safety = key.safety;
  if (safety.kind != Kind::above && safety.kind != Kind::below && safety.kind != Kind::unless &&
      safety.kind != Kind::text)
    return std::nullopt;
  if (std::holds_alternative<bool*>(key.target)) return config::Value(safety.text == "true");
  if (std::holds_alternative<std::string*>(key.target)) {
    if (safety.kind == Kind::text) return config::Value(std::string(safety.text));
    for (const std::string_view name : key.allowed.list())
      if (name != safety.text) return config::Value(std::string(name));
    return config::Value(std::string("/tmp/elsewhere"));
  }
  const bool whole = !std::holds_alternative<double*>(key.target);
  const double further = whole ? 1.0 : 1e-3 * std::max(1.0, std::abs(safety.bound));
  const double value = safety.kind == Kind::below ? safety.bound - further : safety.bound + further;
  if (!key.range.contains(value)) return std::nullopt;
  return whole ? config::Value(static_cast<std::int64_t>(value)) : config::Value(value);
}

}  // namespace

TEST_CASE("a key's weak value is refused by every route, and taken with a consent by every route") {
  const Files files;
  const std::string plain = files.made("plain.toml", std::string("description = \"x\"\n") + phases);
  config::Settings s;
  const config::KeyTable keys(s);
  std::size_t tried = 0;
  for (const config::Key& key : keys.keys()) {
    INFO(key.name);
    const std::optional<config::Value> weak = weak_value(key);
    if (!weak) continue;
    ++tried;
    const std::string toml = config::toml_of(*weak);
    const std::string line = key.name + " = " + toml + '\n';
    std::vector<config::Sources> routes(5, config::Sources{.experiment = plain});
    routes[0].assignments = {key.name + '=' + config::text_of(*weak)};
    routes[1].config_file = files.made("config.toml", line);
    routes[2].changes = {{key.name, *weak, "a study"}};
    routes[3].defaults = {key.name + '=' + config::text_of(*weak)};
    routes[4].experiment =
        files.made("settings.toml", std::string("description = \"x\"\n[settings]\n") + line + phases);
    for (std::size_t route = 0; route < routes.size(); ++route) {
      INFO("route " << route);
      const std::string why = refusal(routes[route]);
      // An experiment's file may set fewer keys; those it refuses by itself.
      CHECK_THAT(why, Contains(key.name));
      if (route < 4) CHECK_THAT(why, Contains("weakens the protection of a real board"));
      const std::string consented = refusal(routes[route], key.name);
      CHECK_THAT(consented, !Contains("weakens the protection of a real board"));
    }
  }
  CHECK(tried > 20);
}

TEST_CASE("numbers of phases have the bounds of the keys that shipped experiments take them from") {
  const Files files;
  const struct {
    const char* lines;
    const char* key;  ///< that bounds it; empty: it is allowed
  } cases[] = {
      {"motor = 1.0\nuntil = { upper_speed_above_rad_s = 500 }\nat_most_s = 20", "experiment.cut_speed_rad_s"},
      {"motor = 1.0\nuntil = { lower_speed_above_rad_s = 251 }\nat_most_s = 20", "experiment.cut_speed_rad_s"},
      {"motor = 1.0\nuntil = { car_speed_above_m_s = 30 }\nat_most_s = 20", "experiment.cut_speed_rad_s"},
      {"motor = 1.0\nuntil = { upper_speed_above_rad_s = 170 }\nat_most_s = 600", "experiment.accelerate_limit_s"},
      {"motor = 0.01\nuntil = { lasts_s = 24 }", "experiment.accelerate_limit_s"},
      {"motor = { points = [[0, 0], [1, 0.2]] }\nuntil = { lasts_s = 21 }", "experiment.accelerate_limit_s"},
      {"motor = 1\nuntil = { lasts_s = 10 }\n[[phase]]\nname = \"q\"\nmotor = 1\nuntil = { lasts_s = 11 }",
       "experiment.accelerate_limit_s"},
      {"brake = { duty = 0.6 }\nuntil = { standstill = true }\nat_most_s = 31", "experiment.brake_limit_s"},
      {"brake = \"controller\"\nuntil = { standstill = true }\nat_most_s = 31", "experiment.brake_limit_s"},
      {"kind = \"hold\"\nbrake = { torque_Nm = 2 }\nuntil = { standstill = true }\nat_most_s = 31",
       "experiment.hold_limit_s"},
      {"motor = 1.0\nuntil = { upper_speed_above_rad_s = 250 }\nat_most_s = 20", ""},
      {"motor = 1\nuntil = { lasts_s = 15 }\n[[phase]]\nname = \"q\"\nuntil = { lasts_s = 1 }\n[[phase]]\nname = "
       "\"r\"\n"
       "motor = 1\nuntil = { lasts_s = 15 }",
       ""},
      {"brake = { duty = 0.6 }\nuntil = { standstill = true }\nat_most_s = 30", ""},
      {"until = { lasts_s = 500 }", ""},
  };
  for (const auto& one : cases) {
    INFO(one.lines);
    const config::Sources sources{.experiment = files.made("phase.toml", script(one.lines))};
    const std::string why = refusal(sources);
    if (*one.key == '\0') {
      CHECK(why == "");
      continue;
    }
    CHECK_THAT(why, Contains("phase \"") && Contains(std::string("--set unsafe.keys=") + one.key));
    CHECK_THAT(refusal(sources, one.key), !Contains("--set unsafe.keys="));
  }
}

TEST_CASE("the identity of a car needs a consent: its limits would see nothing on a rig") {
  for (const std::string key : {"rig.theta_N", "rig.b1_Nm"}) {
    const std::string assignment = key + "=4000";
    CHECK_THAT(refusal({.assignments = {assignment}}), Contains(key + " = 4000") && Contains("unsafe.keys=" + key));
    CHECK(refusal({.assignments = {assignment}}, key).empty());
    CHECK(refusal({.assignments = {key + "=400"}}).empty());
  }
}

TEST_CASE("a run of a series is judged like one that a person asks for") {
  const Files files;
  const std::string text =
      std::string("description = \"x\"\n[series]\nrepeat = 1\n[factors]\nexperiment.brake_limit_s = [20, 60]\n") +
      phases;
  const config::Sources series{.experiment = files.made("series.toml", text)};
  const config::Configuration merged = config::merge(series);
  std::size_t refused = 0;
  for (const config::SeriesMember& member : config::members_of(*merged.script, 1)) {
    config::Sources one = series;
    config::choose(member, one);
    refused += refusal(one).empty() ? 0 : 1;
  }
  CHECK(refused == 1);
}

TEST_CASE("shipped experiments need no consent, and their view says what drives and for how long") {
  for (const std::string name : {"paper", "pulses", "lifted", "locked-stop", "slip-sweep", "duty-ramp", "brake-step",
                                 "coast-down", "coast-and-brake", "friction-jump", "series-of-ten"}) {
    INFO(name);
    const config::SafetyView view = config::safety_view(config::Sources{.backend = "rig", .experiment = name});
    CHECK_NOTHROW(config::refuse_weak_rows(view));
    CHECK_THAT(config::in_words(view), Contains("drive on in the whole run for at most = "));
  }
  const config::SafetyView paper = config::safety_view(config::Sources{.backend = "rig"});
  CHECK_THAT(config::in_words(paper), Contains("phase \"accelerate\": drive on in a row for at most = 20 s  ok") &&
                                          Contains("phase \"accelerate\": drives until a wheel turns at = 170 rad/s"));
}
