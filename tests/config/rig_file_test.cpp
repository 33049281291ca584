// The file of a rig of one's own that `abs_hil init-rig` writes.
#include <fstream>

#include "catch.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::config;
using Catch::Matchers::Contains;

TEST_CASE("a rig's file reads back to the values that it was made of") {
  const test::TemporaryFolder scratch;
  Settings written;
  KeyTable table(written);
  load_file(plant_file("inteco-manual"), table, Tables::of_plant);
  written.plant.rig.wheels.r1_m = 0.1003;
  std::ofstream(scratch / "ours.toml") << rig_file(written, "ours");
  Settings read;
  KeyTable keys(read);
  load_file(scratch / "ours.toml", keys, Tables::of_plant);
  CHECK(rig_file(read, "ours") == rig_file(written, "ours"));
  CHECK(read.plant.rig == written.plant.rig);
  CHECK(read.plant.lever.L_m == written.plant.lever.L_m);
  for (const Key& key : keys.keys()) {
    INFO(key.name);
    if (key.name.starts_with("plant.")) CHECK(keys.was_set(key.name));
  }
}

TEST_CASE("a rig's file says of each parameter of a rig where to read it off") {
  Settings settings;
  const KeyTable keys(settings);
  const std::string text = rig_file(settings, "ours");
  for (const Key& key : keys.keys()) {
    if (model_key(keys.keys(), key.name) == nullptr) continue;
    INFO(key.name);
    CHECK_FALSE(key.on_rig.empty());
    CHECK_THAT(text, Contains("# on the rig: " + std::string(key.on_rig) + "\n" + key.name.substr(6) + " = "));
  }
  CHECK_THAT(text, Contains("--backend rig --set rig.identity=ours.toml --model ours.toml "));
  CHECK_THAT(text, Contains("# upper wheel radius; [0.01, 1] m\n"));
}
