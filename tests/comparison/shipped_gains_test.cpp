// The rivals ship with the gains that the search found (docs/comparison.md), the paper's controller with the paper's.

#include <variant>

#include "abs_hil/comparison/tuning.hpp"
#include "abs_hil/settings/config_file.hpp"
#include "abs_hil/settings/key_table.hpp"
#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::comparison;

namespace {

settings::Settings with_file_of(std::string_view controller) {
  settings::Settings settings;
  settings::KeyTable table(settings);
  settings::load_file(settings::config_dir() / "tuned" / (std::string(controller) + ".toml"), table);
  return settings;
}

nlohmann::ordered_json json_of(settings::Settings settings) { return settings::KeyTable(settings).to_json(); }

}  // namespace

TEST_CASE("every rival's shipped gains are those that the search recorded") {
  int rivals = 0;
  for (const std::string_view controller : tunable_controllers()) {
    if (controller == "adaptive") continue;
    INFO(controller);
    CHECK(json_of(with_file_of(controller)) == json_of({}));
    ++rivals;
  }
  CHECK(rivals >= 6);
}

TEST_CASE("the recorded gains lie in the ranges searched") {
  for (const std::string_view controller : tunable_controllers()) {
    settings::Settings settings = with_file_of(controller);
    const settings::KeyTable table(settings);
    for (const TunedKey& tuned : tuned_keys(controller)) {
      for (const settings::Key& key : table.keys()) {
        if (key.name != tuned.name) continue;
        INFO(tuned.name);
        const double value = *std::get<double*>(key.target);
        CHECK((value >= tuned.search.least && value <= tuned.search.most));
      }
    }
  }
}

TEST_CASE("the paper's controller ships with Table 1's gains, not with searched ones") {
  const control::AdaptiveOptions shipped = settings::Settings().control.adaptive;
  CHECK((shipped.gamma == 21.0 && shipped.ks0 == 19.0 && shipped.ks1 == 32.0 && shipped.zeta0 == 0.0));
  CHECK(json_of(with_file_of("adaptive")) != json_of({}));
}
