#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// One configuration value: its row (rig/option.hpp), its dotted name and where it is kept.
struct Key : rig::OptionFacts {
  std::string name;
  rig::OptionTarget target;
};

/// A value from a file or from the command line, before its key has checked the type.
using Value = std::variant<double, std::int64_t, bool, std::string>;

/// Converts `text` to a value for the key. A key of text takes it unchanged; other keys read it as TOML would.
[[nodiscard]] Value parse_value(const Key& key, std::string_view text);

/// The key with this name; null without one.
[[nodiscard]] const Key* find_key(const std::vector<Key>& keys, std::string_view name);

/// "model.x" for "plant.x"; null for a value that only the plant has, and for a name that is not of the plant.
[[nodiscard]] const Key* model_key(const std::vector<Key>& keys, std::string_view name);

/// The value that the key has.
[[nodiscard]] Value value_of(const Key& key);
/// The value as a number; nothing for flags and texts.
[[nodiscard]] std::optional<double> number_of(const Value& value);
/// The value as --set takes it.
[[nodiscard]] std::string text_of(const Value& value);
/// The value as JSON and as TOML hold it.
[[nodiscard]] nlohmann::ordered_json json_of(const Value& value);
[[nodiscard]] std::string toml_of(const Value& value);

/// How the key bears on the safety of a run on a board: as its row says, otherwise as its table. Unclassed in
/// `driver.`, `gate.`, `guardian.`, `realtime.` and `experiment.`, whose rows must say it.
[[nodiscard]] rig::SafetyClass safety_of(const Key& key);

/// The number that the settings have for this key, as text; empty for any other text. Not real-time safe.
[[nodiscard]] std::string number_text(const Settings& settings, std::string_view name);

/// All configuration values by their dotted names. The table is made from the rows of the options.
/// A value `model.x` that nobody sets follows `plant.x`, in whatever order the values are set.
class KeyTable {
 public:
  /// Refers to `settings`, which must outlive the table. A value of its model that is not the plant's counts as set.
  explicit KeyTable(Settings& settings);

  /// For a real rig, which has a model but no simulated plant: from now on `set` refuses `plant.`, the plant's values
  /// follow the model's, and the effective configuration contains the whole model instead of the plant.
  void leave_out_plant();

  /// Sets a value. `origin` says where it came from ("--set", "FILE:LINE"). Throws ConfigError for an unknown name
  /// (with the nearest known one), a value of the wrong type or out of range; then nothing changes.
  void set(std::string_view name, const Value& value, std::string_view origin);
  /// The name and the value of "name=value", without blanks around them. Throws ConfigError for any other text, and for
  /// an unknown name.
  [[nodiscard]] std::pair<std::string, Value> parsed(std::string_view assignment, std::string_view origin) const;
  /// Sets `name=value`.
  void set_text(std::string_view assignment, std::string_view origin);

  [[nodiscard]] const std::vector<Key>& keys() const noexcept { return keys_; }
  /// True if a file or an option gave the value. False if it is the default.
  [[nodiscard]] bool was_set(std::string_view name) const { return set_.contains(name); }
  /// The effective configuration, nested as in a file.
  [[nodiscard]] nlohmann::ordered_json to_json() const;
  /// The effective configuration as a TOML file that load_file reads back to the same values.
  [[nodiscard]] std::string to_toml() const;

 private:
  [[nodiscard]] const Key& find(std::string_view name, std::string_view origin) const;
  /// True if the value is part of the effective configuration.
  [[nodiscard]] bool is_effective(const Key& key) const;
  void refuse_plant(std::string_view name, std::string_view origin) const;
  /// Carries a new value over to the other of plant and model, if that one follows.
  void carry_over(const Key& key);

  std::vector<Key> keys_;
  bool has_plant_{true};
  std::set<std::string, std::less<>> set_;  ///< names of the values that a file or an option gave
};

/// Sets every value of an effective configuration, as KeyTable::to_json writes it. Throws ConfigError for a value that
/// does not fit its key. Returns the unknown names, which another version wrote.
[[nodiscard]] std::vector<std::string> load_json(const nlohmann::ordered_json& config, KeyTable& table,
                                                 std::string_view origin);
/// Sets the values of some tables of an effective configuration, given as JSON text. Throws ConfigError for a value
/// that does not fit its key, for a table that is missing, and for text that is not JSON.
void load_tables(std::string_view text, std::initializer_list<const char*> tables, KeyTable& keys,
                 std::string_view origin);

/// A plant's file to fill in for a rig of one's own: every key of `plant` with its value in `settings`, its meaning,
/// unit and range, and where to read it off the rig. It can be given to --plant and --model at once.
/// @param name  of the rig, for the first lines
[[nodiscard]] std::string rig_file(const Settings& settings, std::string_view name);

}  // namespace abs_hil::config
