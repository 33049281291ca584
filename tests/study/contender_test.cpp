// The list of controllers with settings of their own.
#include <fmt/format.h>

#include <fstream>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "paper_plan.hpp"
#include "study/study_script.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using namespace abs_hil::study::test;
using Catch::Matchers::Contains;

TEST_CASE("the list of controllers is split at the commas outside of braces") {
  CHECK(split_contenders("adaptive,pi{kp=1,ki=2},x.toml") ==
        std::vector<std::string>{"adaptive", "pi{kp=1,ki=2}", "x.toml"});
  const auto all = split_contenders("all");
  CHECK(all.size() > 10);
  CHECK(all.front() == "adaptive");
  CHECK_THROWS_WITH(split_contenders("adaptive,"), Contains("empty entry"));
  CHECK_THROWS_WITH(split_contenders("adaptive{gamma=1"), Contains("braces"));
  CHECK_THROWS_WITH(split_contenders("adaptive}gamma=1{"), Contains("braces"));
}

TEST_CASE("a contender has the settings of its own over the common ones") {
  config::Settings common;
  common.control.slip_ref = 0.1;
  const Contender soft =
      read_contender("soft=adaptive{gamma=60,control.adaptive.ka1=3,slip_ref=0.12,model.theta_N=20}", common);
  CHECK(soft.name == "soft");
  CHECK(soft.settings.control.controller == "adaptive");
  CHECK(soft.settings.control.adaptive.gamma == 60.0);
  CHECK(soft.settings.control.adaptive.ka1 == 3.0);
  CHECK(soft.settings.control.slip_ref == 0.12);
  CHECK(soft.settings.model.tyre.theta_N == 20.0);
  CHECK(soft.settings.plant.rig.tyre.theta_N == common.plant.rig.tyre.theta_N);
  CHECK(soft.changes.front() == std::pair<std::string, std::string>("control.adaptive.gamma", "60"));
  CHECK(read_contender("adaptive{ gamma = 60 }", common).settings.control.adaptive.gamma == 60.0);
  CHECK(read_contender("adaptive{gamma=60}", common).name == "adaptive{gamma=60}");
  CHECK(read_contender("pi", common).settings.control.slip_ref == 0.1);
}

TEST_CASE("a file can describe a contender") {
  const abs_hil::test::TemporaryFolder scratch;
  const std::string file = (scratch / "gentle.toml").string();
  std::ofstream(file) << "[control]\ncontroller = \"pi\"\n[control.pi]\nkp_per_s = 12\n";
  const Contender gentle = read_contender(file, {});
  CHECK(gentle.name == "gentle");
  CHECK(gentle.settings.control.controller == "pi");
  CHECK(gentle.settings.control.pi.kp_per_s == 12.0);
  CHECK(read_contender("other=" + file, {}).name == "other");
  CHECK_THROWS_WITH(read_contender("pi{" + file + "}", {}), Contains("before the braces"));
  std::ofstream(file) << "[control.pi]\nkp_per_s = 12\n";
  CHECK(read_contender("pi{" + file + ",ki_per_s2=3}", {}).settings.control.pi.kp_per_s == 12.0);
  CHECK_THROWS_WITH(read_contender(file, {}), Contains("names no controller"));
  std::ofstream(file) << "[plant]\ntheta_N = 12\n";
  CHECK_THROWS_WITH(read_contender(file, {}), Contains("plant.theta_N") && Contains("same plants") && Contains(":2"));
}

TEST_CASE("bad contenders are refused with the entry, the key and the fix") {
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      static_cast<void>(read_contender(text, {}));
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  };
  CHECK_THAT(refusal("adaptiv"), Contains("adaptiv") && Contains("adaptive"));
  CHECK_THAT(refusal("adaptive{gamma}"), Contains("KEY=VALUE"));
  CHECK_THAT(refusal("adaptive{}"), Contains("KEY=VALUE"));
  CHECK_THAT(refusal("adaptive{gama=60}"), Contains("gama") && Contains("gamma"));
  CHECK_THAT(refusal("adaptive{gamma=-1}"), Contains("control.adaptive.gamma"));
  CHECK_THAT(refusal("adaptive{plant.theta_N=20}"), Contains("--set plant.theta_N"));
  CHECK_THAT(refusal("adaptive{controller=pi}"), Contains("before the braces"));
  CHECK_THAT(refusal("adaptive{gamma=60}x"), Contains("nothing may follow"));
  CHECK_THAT(refusal("=adaptive"), Contains("label"));
  CHECK_THAT(refusal("missing.toml"), Contains("missing.toml"));
}

TEST_CASE("a variant with the default gain equals the plain controller, and another gain differs") {
  const Study study = paper_study({"adaptive", "same=adaptive{gamma=21}", "adaptive{gamma=80}"}, 3);
  REQUIRE(paper_settings().control.adaptive.gamma == 21.0);
  const std::vector<RunResult> runs = runs_of(study);
  const auto distance = [&](std::size_t c) { return runs[3 + c].metrics.stop_distance_m; };
  CHECK(distance(1) == distance(0));
  CHECK(distance(2) != distance(0));
  CHECK(study.contenders(0)[2].name == "adaptive{gamma=80}");
  CHECK(study.contenders(0)[2].settings.control.controller == "adaptive");
}
