// Reading an experiment's script: quantities and their units, names, explanations.
#include "config/script.hpp"

#include <cmath>
#include <numbers>

#include "catch.hpp"
#include "config/plan.hpp"

using namespace abs_hil;
using namespace abs_hil::config;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinRel;

namespace {

Script parsed(const std::string& text) {
  return parse(text, "test.toml", [](const std::string& name) -> std::optional<std::string> {
    if (name == "ramp.csv") return "time_s,value\r\n0,0\r\n1,0.5\r\n";
    return std::nullopt;
  });
}

}  // namespace

TEST_CASE("quantities take their own units only") {
  CHECK(parse_quantity("20 ms", "s") == 0.02);
  CHECK(parse_quantity("1.5min", "s") == 90.0);
  CHECK_THAT(*parse_quantity("1700 rpm", "rad/s"), WithinRel(1700.0 * 2.0 * std::numbers::pi / 60.0, 1e-15));
  CHECK_THAT(*parse_quantity("36 km/h", "m/s"), WithinRel(10.0, 1e-15));
  CHECK(parse_quantity("-3 mm", "m") == -0.003);
  CHECK(parse_quantity("2 N m", "N m") == 2.0);
  CHECK(parse_quantity("60 %", "") == 0.6);
  for (const char* bad : {"", "s", "2", "2 m", "2 S", "2 s s", "0x10 s", "1,5 s", "2 s "}) {
    CHECK_FALSE(parse_quantity(bad, "s"));
  }
}

TEST_CASE("a profile's file is read as a person writes it and as spreadsheets save it") {
  const auto points_of = [](const std::string& csv) {
    const Script script = parse("[[phase]]\nname = \"x\"\nmotor = { file = \"p.csv\" }\nuntil = { lasts_s = 1 }\n",
                                "test.toml", [&csv](const std::string&) { return csv; });
    std::vector<std::pair<double, double>> points;
    for (const auto& [time, value] : script.phases.at(0).motor->points) points.emplace_back(time.value, value.value);
    return points;
  };
  const std::vector<std::pair<double, double>> wanted{{0.0, 0.25}, {1.5, 0.5}};
  CHECK(points_of("time_s,value\n0,0.25\n1.5,0.5") == wanted);
  CHECK(points_of("\xEF\xBB\xBFtime_s,value\r\n0,0.25\r\n1.5,0.5\r\n") == wanted);
  CHECK(points_of("\xEF\xBB\xBF\"time_s\";\"value\"\r\n0;0,25\r\n\"1,5\";0,5\r\n;\r\n") == wanted);
  CHECK(points_of("time_s\tvalue\r0\t0,25\r1.5\t0.5\r") == wanted);
  CHECK(points_of("# from a spreadsheet, \xC3\xBC\n\n value , note, time_s\n0.25, a, 0\n# half\n0.5,\"b\", 1.5\n\n") ==
        wanted);
  CHECK(points_of("\"time_s\",\"value\"\n\"0\",\"0,25\"\n\"1,5\",\"0,5\"\n") == wanted);
  CHECK_THROWS_WITH(points_of("\xFF\xFEt\0i\0"), Contains("\"p.csv\" is not UTF-8 text; save it as CSV in UTF-8"));
  CHECK_THROWS_WITH(points_of(""), Contains("holds no points"));
  CHECK_THROWS_WITH(points_of("\xEF\xBB\xBFtime_s,value\n"), Contains("holds no points"));
  for (const char* wrong : {"time_s\n0\n", "time_s,phase\n0,idle\n", "0,0.25\n1.5,0.5\n", "time;value\n0;0\n"}) {
    CHECK_THROWS_WITH(points_of(wrong), Contains("the first line is wrong; give time_s,value"));
  }
  for (const char* wrong : {"0;1.234,5", "0", "0;", "0;NaN", "0;2", "0;0,5x", "\"0;0,5", "0 0;0,5"}) {
    INFO(wrong);
    CHECK_THROWS_WITH(points_of(std::string("# a comment\ntime_s;value\n") + wrong + "\n"),
                      Contains("\"p.csv\", line 3: "));
  }
}

TEST_CASE("a script is read whole") {
  const Script script = parsed(R"(
description = "d"
author = "a"
[settings]
control.slip_ref = 0.1
[[phase]]
name = "run-up"
kind = "accelerate"
motor = { file = "ramp.csv" }
until.any = [{ upper_speed_above = "1000 rpm" }, { all = [{ slip_below = 0.1 }, { distance_m = 3 }] }]
at_most = "1 min"
[[phase]]
name = "brake"
brake = { torque_Nm = { before = 1, after = 2, at = "500 ms" } }
until = { standstill = true }
at_most_s = 9
[limits]
run_time_s = 30
[[event]]
at_s = 1
friction = 0.5
over_s = 0.2
[series]
repeat = 3
seed = 7
pause = "1 min"
[factors]
control.controller = ["adaptive", "pi"]
control.slip_ref = { from = 0.1, to = 0.2, steps = 3 }
)");
  REQUIRE(script.phases.size() == 2);
  const PhaseScript& first = script.phases[0];
  CHECK(first.kind == rig::Phase::accelerate);
  CHECK(first.motor->points.size() == 2);
  CHECK(script.files.at("ramp.csv").starts_with("time_s"));
  REQUIRE(first.until.size() == 2);
  CHECK(first.until[1].kind == experiment::EndKind::all);
  CHECK(first.until[1].parts[1].value.value == 3.0);
  CHECK(first.at_most->value == 60.0);
  CHECK(script.phases[1].brake.profile()->points.size() == 3);
  CHECK(script.limits.run_time->value == 30.0);
  CHECK(script.events[0].at_s == 1.0);
  CHECK(script.events[0].end_s == 1.2);
  CHECK(script.series.repeat == 3);
  CHECK(script.series.seed == 7);
  CHECK(script.series.pause_s == 60.0);
  REQUIRE(script.factors.size() == 2);
  CHECK(script.factors[0].key == "control.controller");
  CHECK(std::get<double>(std::get<Levels>(script.factors[1].values).values[1]) == 0.15000000000000002);
}

TEST_CASE("every shipped experiment has a description and an explanation") {
  config::Settings settings;
  const auto known = known_experiments();
  CHECK(known.size() >= 6);
  for (const auto& script : known) {
    INFO(script->name);
    CHECK_FALSE(script->description.empty());
    CHECK_THAT(explain(*script, settings), Contains(script->name + ": "));
  }
}

TEST_CASE("an unknown experiment names the nearest and all known ones") {
  CHECK_THROWS_WITH(find("papr"), Contains("papr") && Contains("the nearest is paper") && Contains("friction-jump"));
  CHECK_THROWS_WITH(find("/nowhere/x.toml"), Contains("/nowhere/x.toml"));
}

TEST_CASE("the explanation has actions, ends and numbers of runs") {
  config::Settings settings;
  const std::string words = explain(*find("paper"), settings);
  CHECK_THAT(words, Contains("motor duty 1, brake off") && Contains("until the upper wheel reaches 170 rad/s") &&
                        Contains("brake controller adaptive, slip reference 0.15") &&
                        Contains("until the car is slower than 0.3 m/s") && Contains("a fault after 30 s"));
  CHECK_THAT(explain(*find("series-of-ten"), settings), Contains("Series of 10 runs") && Contains("30 s apart"));
}

TEST_CASE("the explanation distinguishes steps from ramps") {
  const config::Settings settings;
  CHECK_THAT(explain(*find("brake-step"), settings),
             Contains("brake torque 0.5 N m, from 0.5 s on 1 N m, from 1 s on 2 N m\n"));
  CHECK_THAT(explain(*find("slip-sweep"), settings),
             Contains("slip reference 0.01, from 0 s to 1.2 s rising to 0.2\n"));
  const auto words_for = [&settings](const std::string& points) {
    return explain(parsed("[[phase]]\nname = \"brake\"\nbrake = { duty = { points = " + points +
                          " } }\nuntil = { lasts_s = 1 }\n[[phase]]\nname = \"stopped\"\nuntil = { lasts_s = 1 }\n"),
                   settings);
  };
  CHECK_THAT(words_for("[[0, 0.1], [1, 0.1], [1, 0.3], [2, 0.3]]"), Contains("brake duty 0.1, from 1 s on 0.3\n"));
  CHECK_THAT(words_for("[[0.5, 0.2]]"), Contains("brake duty 0.2\n"));
  CHECK_THAT(words_for("[[0, 0.2], [1, 0], [1, 0.2]]"),
             Contains("brake duty 0.2, from 0 s to 1 s falling to 0, from 1 s on 0.2\n"));
}
