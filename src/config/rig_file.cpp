// Writes a plant's file with the meaning, unit and range of each key, to be filled in.
#include <fmt/format.h>

#include "config/explain.hpp"
#include "config/key_table.hpp"

namespace abs_hil::config {

namespace {

constexpr std::string_view plant_prefix = "plant.";

std::string facts_of(const Key& key) {
  const bool is_number =
      std::holds_alternative<double*>(key.target) || std::holds_alternative<std::int32_t*>(key.target);
  std::string text = fmt::format("# {}", key.meaning);
  if (is_number) text += fmt::format("; {}{}{}", key.range.text(), key.unit.empty() ? "" : " ", key.unit);
  if (!key.allowed.empty()) text += fmt::format("; {}", fmt::join(key.allowed.list(), ", "));
  return text + '\n';
}

/// The keys of the rig's parameters, or those of the simulation only.
std::string section(const KeyTable& keys, bool of_rig) {
  std::string text;
  for (const Key& key : keys.keys()) {
    if (!key.name.starts_with(plant_prefix) || key.on_rig.empty() == of_rig) continue;
    text += '\n' + facts_of(key);
    if (of_rig) text += fmt::format("# on the rig: {}\n", key.on_rig);
    text += fmt::format("{} = {}\n", key.name.substr(plant_prefix.size()), toml_of(value_of(key)));
  }
  return text;
}

}  // namespace

std::string rig_file(const Settings& settings, std::string_view name) {
  Settings copy = settings;
  const KeyTable keys(copy);
  return fmt::format(
             "# The rig {0}. Replace the values by those of your rig; until then they are those of {1}.\n"
             "#   abs_hil --plant {0}.toml                         simulates it\n"
             "#   abs_hil commission --set rig.identity={0}.toml   tries the rig out; each run needs both options:\n"
             "#   abs_hil --backend rig --set rig.identity={0}.toml --model {0}.toml   limits, and what to believe\n"
             "description = \"the rig {0}\"\n\n[plant]\n"
             "# ---- read off the rig",
             name, settings.plant_name) +
         '\n' + section(keys, true).substr(1) + "\n# ---- of the simulation only\n" + section(keys, false);
}

}  // namespace abs_hil::config
