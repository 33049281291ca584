// The baselines ship with the gains that the search found (docs/comparison.md), the adaptive law with the paper's.

#include <nlohmann/json.hpp>
#include <variant>

#include "catch.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "study/tuning.hpp"

using namespace abs_hil;
using namespace abs_hil::study;

namespace {

config::Settings with_file_of(std::string_view controller) {
  config::Settings settings;
  config::KeyTable table(settings);
  config::load_file(config::config_dir() / "tuned" / (std::string(controller) + ".toml"), table);
  return settings;
}

nlohmann::ordered_json json_of(config::Settings settings) { return config::KeyTable(settings).to_json(); }

}  // namespace

TEST_CASE("every baseline's shipped gains are those that the search recorded") {
  int baselines = 0;
  for (const std::string_view controller : tunable_controllers()) {
    if (controller == "adaptive") continue;
    INFO(controller);
    CHECK(json_of(with_file_of(controller)) == json_of({}));
    ++baselines;
  }
  CHECK(baselines >= 6);
}

TEST_CASE("the recorded gains lie in the ranges searched") {
  for (const std::string_view controller : tunable_controllers()) {
    config::Settings settings = with_file_of(controller);
    const config::KeyTable table(settings);
    for (const TunedKey& tuned : tuned_keys(controller)) {
      for (const config::Key& key : table.keys()) {
        if (key.name != tuned.name) continue;
        INFO(tuned.name);
        const double value = *std::get<double*>(key.target);
        CHECK((value >= tuned.search.least && value <= tuned.search.most));
      }
    }
  }
}

TEST_CASE("the paper's controller ships with Table 1's gains, not with searched ones") {
  const control::AdaptiveOptions shipped = config::Settings().control.adaptive;
  CHECK((shipped.gamma == 21.0 && shipped.ks0 == 19.0 && shipped.ks1 == 32.0 && shipped.zeta0 == 0.0));
  CHECK(json_of(with_file_of("adaptive")) != json_of({}));
}
