// Every bad study is refused with one line that begins with its place.
#include "catch.hpp"
#include "config/config_error.hpp"
#include "study/study_script.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

struct Bad {
  const char* text;
  const char* place;  ///< LINE:COLUMN
  std::vector<std::string> words;
};

std::string refusal_of(const char* text) try {
  static_cast<void>(study::parse_study(text, "s.toml"));
  return {};
} catch (const config::ConfigError& error) {
  return error.what();
}

}  // namespace

TEST_CASE("bad studies are refused with line and column") {
  const std::vector<Bad> all{
      {"plant = [\"x\"]", "1:1", {"unknown key \"plant\"", "plants"}},
      {"x = = 1", "1:5", {"not valid TOML"}},
      {"\nplants = \"x\"", "2:10", {"give a list of texts"}},
      {"plants = []", "1:10", {"give a list of texts"}},
      {"controllers = [\"pi{\"]", "1:15", {"braces do not match"}},
      {"chunk = 0", "1:9", {"whole number in [1, 1000000]"}},
      {"model_follows = \"all\"", "1:17", {"\"nominal\", \"factors\""}},
      {"[settings]\ncontrol.slipref = 1", "2:9", {"control.slip_ref"}},
      {"[settings]\ncontrol.slip_ref = 7", "2:20", {"control.slip_ref = 7", "(0, 1)"}},
      {"[settings]\nrealtime.priority = 7", "2:10", {"must not set"}},
      {"[design]\nkind = \"grid\"\npoints = 3", "1:1", {"leave points out"}},
      {"[design]\nkind = \"sobl\"\npoints = 3", "2:8", {"latin-hypercube"}},
      {"[design]\npoints = 3", "1:1", {"no \"kind\""}},
      {"[design]\nkind = \"sobol\"\npoints = 3", "1:1", {"no factor has a range"}},
      {"[design]\nkind = \"sobol\"\n[factors]\nplant.B = { from = 20, to = 21 }", "1:1", {"no \"points\""}},
      {"[factors]\nplant.B = { from = 20, to = 21 }", "1:1", {"no [design]"}},
      {"[[metric]]\nname = \"x\"\nof = \"slip\"", "1:1", {"no \"take\""}},
      {"[[metric]]\nname = \"x y\"\nof = \"slip\"\ntake = \"max\"", "2:8", {"letters, digits"}},
      {"[[metric]]\nname = \"x\"\nof = \"slip\"\ntake = \"median\"", "4:8", {"\"rms\""}},
      {"[[metric]]\nname = \"x\"\nof = \"slip\"\ntake = \"max\"\nafter = 3", "5:9", {"no unit", "after_s"}},
      {"[repeat]\nvary = \"none\"", "1:1", {"no \"runs\""}},
      {"[repeat]\nruns = 5\nvary = \"thetta=0.1\"", "3:8", {"thetta"}},
      {"[factors]\nplant.theta = [1]", "2:7", {"plant.theta_N"}},
      {"[factors]\nplant.theta_N = 20", "2:17", {"give a list of values"}},
      {"[factors]\nplant.theta_N = []", "2:17", {"give a list of values"}},
      {"[factors]\nplant.theta_N = [20,\n -1]", "3:2", {"plant.theta_N = -1", "(0, 100000]"}},
      {"[factors]\nplant.theta_N = [[1]]", "2:18", {"neither a number"}},
      {"[factors]\nplant.theta_N = { from = 20 }", "2:17", {"has no to"}},
      {"[factors]\nplant.theta_N = { from = 20, to = 900000 }", "2:17", {"plant.theta_N = 900"}},
      {"[factors]\nplant.theta_N = { from = 20, to = 20 }", "2:17", {"both ends are 20"}},
      {"[factors]\nplant.theta_N = { from = 20, to = 30, step = 2 }", "2:39", {"unknown key \"step\"", "steps"}},
      {"[factors]\nplant.theta_N = { from = 20, to = 30, sd = 2 }", "2:19", {"leave from out"}},
      {"[factors]\nplant.theta_N = { from = 20, to = 30, most = 2 }", "2:39", {"belongs to a normal range"}},
      {"[factors]\nplant.theta_N = { mean = 20 }", "2:17", {"has no sd"}},
      {"[factors]\nplant.theta_N = { mean = 20, sd = 0 }", "2:35", {"sd = 0"}},
      {"[factors]\nplant.theta_N = { mean = -20, sd = 1 }", "2:17", {"nothing of the normal range"}},
      {"[factors]\nplant.theta_N = { mean = 20, sd = 1, least = 30, most = 10 }", "2:17", {"least below most"}},
      {"[factors]\nplant.mu_w1 = { from = -1, to = 1, scale = \"log\" }", "2:15", {"above 0"}},
      {"[factors]\nplant.encoder_counts_per_rev = { from = 1000, to = 2000 }", "2:32", {"only a real number"}},
      {"[factors]\ncontrol.controller = [\"pi\"]", "2:9", {"cannot be a factor", "controllers"}},
      {"[factors]\nexperiment.name = [\"paper\"]", "2:12", {"cannot be a factor", "experiments"}},
      {"[factors]\nrun.seed = [1]", "2:5", {"cannot be a factor"}},
  };
  for (const Bad& bad : all) {
    INFO(bad.text);
    const std::string message = refusal_of(bad.text);
    CHECK_THAT(message, Catch::Matchers::StartsWith(std::string("s.toml:") + bad.place + ": "));
    CHECK(message.find('\n') == std::string::npos);
    for (const std::string& word : bad.words) CHECK_THAT(message, Contains(word));
  }
}

TEST_CASE("an empty study is one run of the paper's controller") {
  const study::StudyScript script = study::parse_study("", "s.toml");
  CHECK(script.controllers == std::vector<std::string>{"adaptive"});
  CHECK(script.repeat.runs == 1);
  CHECK(script.repeat.variation == study::Variation{});
}

TEST_CASE("factors keep the order of the file") {
  const study::StudyScript script =
      study::parse_study("[factors]\nplant.theta_N = [20]\ncontrol.slip_ref = [0.1]\nplant.B = [20, 21.5]\n", "s.toml");
  REQUIRE(script.factors.size() == 3);
  CHECK(script.factors[0].key == "plant.theta_N");
  CHECK(script.factors[1].key == "control.slip_ref");
  CHECK(script.factors[2].key == "plant.B");
}
