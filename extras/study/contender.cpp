// Reads LABEL=CONTROLLER{KEY=VALUE,...} over common settings.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "rig/formatted_text.hpp"
#include "study/study_script.hpp"

namespace abs_hil::study {

namespace {

constexpr std::string_view controller_key = "control.controller";
constexpr std::string_view file_ending = ".toml";

[[noreturn]] void refuse(std::string_view entry, std::string_view why) {
  throw std::invalid_argument(fmt::format("--controllers: {}: {}", entry, why));
}

void check_key(std::string_view entry, std::string_view key) {
  if (key == controller_key) refuse(entry, "name the controller before the braces");
  if (key.starts_with("control.") || key.starts_with("model.")) return;
  refuse(entry,
         fmt::format("{} cannot differ between controllers, which all meet the same plants and experiment; give a "
                     "key of control or model, or --set {} for all",
                     key, key));
}

/// The key's full name: as it is, with "control.", or with the controller's own section.
std::string full_name(const config::KeyTable& keys, std::string_view key, const std::string& controller) {
  for (const std::string& prefix : {std::string(), std::string("control."), control::section_of(controller)}) {
    const std::string name = prefix + std::string(key);
    if (config::find_key(keys.keys(), name) != nullptr) return name;
  }
  return std::string(key);
}

void set(Contender& contender, config::KeyTable& keys, const std::string& name, const config::Value& value,
         const std::string& origin) {
  keys.set(name, value, origin);
  contender.changes.emplace_back(name, config::text_of(value));
}

/// True if the file names the controller.
bool read_file(Contender& contender, config::KeyTable& keys, const std::string& file, const std::string& entry,
               bool may_name_controller) {
  bool named = false;
  for (const config::FileValue& value : config::read_file(file)) {
    const bool names = value.name == controller_key;
    if (!names || !may_name_controller) check_key(fmt::format("{} ({})", entry, value.origin), value.name);
    set(contender, keys, value.name, value.value, value.origin);
    named = named || names;
  }
  return named;
}

/// Reads what stands between the braces: KEY=VALUE and files, with commas between them.
void read_changes(Contender& contender, std::string_view changes, const std::string& entry) {
  config::KeyTable keys(contender.settings);
  for (const std::string_view change : rig::split(changes, ',')) {
    const std::size_t equals = change.find('=');
    if (equals == std::string_view::npos && change.ends_with(file_ending)) {
      read_file(contender, keys, std::string(change), entry, false);
      continue;
    }
    if (equals == std::string_view::npos) {
      refuse(entry, fmt::format("\"{}\": give KEY=VALUE or a TOML file, as in adaptive{{gamma=60}}", change));
    }
    const std::string name =
        full_name(keys, rig::trimmed(change.substr(0, equals)), contender.settings.control.controller);
    const std::string_view text = rig::trimmed(change.substr(equals + 1));
    const config::Key* key = config::find_key(keys.keys(), name);
    if (key != nullptr) check_key(entry, name);
    set(contender, keys, name, key == nullptr ? config::Value(std::string(text)) : config::parse_value(*key, text),
        "--controllers");
  }
}

}  // namespace

std::vector<std::string> split_contenders(std::string_view list) {
  if (list == "all") {
    std::vector<std::string> all;
    for (const control::ControllerEntry& entry : control::controllers()) all.emplace_back(entry.name);
    return all;
  }
  std::vector<std::string> entries(1);
  bool within = false;
  for (const char c : list) {
    if (c == (within ? '{' : '}')) refuse(list, "the braces do not match");
    if (c == '{' || c == '}') within = !within;
    if (c == ',' && !within) {
      entries.emplace_back();
    } else {
      entries.back() += c;
    }
  }
  if (within) refuse(list, "the braces do not match");
  if (std::any_of(entries.begin(), entries.end(), [](const std::string& entry) { return entry.empty(); })) {
    refuse(list, "empty entry; give controllers with commas between them, or all");
  }
  return entries;
}

Contender read_contender(const std::string& text, const config::Settings& common) {
  const std::size_t brace = text.find('{');
  const std::size_t equals = text.find('=');
  const bool labelled = equals < brace && equals != std::string::npos;
  Contender contender{.name = labelled ? text.substr(0, equals) : text, .settings = common};
  std::string what = labelled ? text.substr(equals + 1) : text;
  if (contender.name.empty()) refuse(text, "the label before = is empty");
  if (what.ends_with(file_ending)) {
    if (!labelled) contender.name = std::filesystem::path(what).stem().string();
    config::KeyTable keys(contender.settings);
    if (!read_file(contender, keys, what, text, true)) {
      refuse(text,
             fmt::format("the file names no controller; set {} in it, or give CONTROLLER{{{}}}", controller_key, what));
    }
    return contender;
  }
  const std::size_t open = what.find('{');
  contender.settings.control.controller = what.substr(0, open);
  // Before the changes, whose short names depend on the controller.
  static_cast<void>(control::make_controller(contender.settings.control.controller, {common.control, common.model}));
  if (open == std::string::npos) return contender;
  if (!what.ends_with('}')) refuse(text, "nothing may follow the braces");
  read_changes(contender, std::string_view(what).substr(open + 1, what.size() - open - 2), text);
  return contender;
}

}  // namespace abs_hil::study
