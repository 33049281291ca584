#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/grammar.hpp"
#include "config/script.hpp"

namespace abs_hil::config {

[[nodiscard]] inline Place place_of(const toml::source_region& region) noexcept {
  return {region.begin.line, region.begin.column};
}

/// The script's path, for errors, and the table of configuration keys, for look-ups.
class Source {
 public:
  explicit Source(std::string path) : path_(std::move(path)), keys_(settings_) {}
  [[noreturn]] void fail(Place place, std::string_view message) const;
  [[nodiscard]] std::string at(Place place) const;
  /// Returns the configuration key of that name. Fails for an unknown name, with the nearest known one.
  [[nodiscard]] const config::Key& key(std::string_view name, Place place) const;
  /// True for a configuration key, and for a table of them, as in "control".
  [[nodiscard]] bool is_setting(std::string_view name) const;
  /// Fails unless the configuration key takes that value.
  void check_value(std::string_view name, const config::Value& value, Place place) const;

 private:
  std::string path_;
  mutable config::Settings settings_{};
  mutable config::KeyTable keys_;
};

/// One key of a table with its value.
struct Entry {
  const Field* field{nullptr};
  std::string key;         ///< as written
  bool has_suffix{false};  ///< the key says the unit
  const toml::node* node{nullptr};
  Place place{};  ///< of the value
  Place key_place{};
};

/// Reads a table by its grammar. The constructor refuses unknown and missing keys. The other members read values.
class TableReader {
 public:
  /// @param place where the table stands if TOML does not say
  TableReader(const Source& source, const toml::table& table, const Grammar& grammar, Place place);

  [[nodiscard]] const Entry* find(std::string_view name) const noexcept;
  [[nodiscard]] const std::vector<Entry>& entries() const noexcept { return entries_; }
  [[nodiscard]] Place place() const noexcept { return place_; }

  [[nodiscard]] std::string text(const Entry& entry) const;
  [[nodiscard]] std::string choice(const Entry& entry) const;
  [[nodiscard]] Number number(const Entry& entry) const;
  [[nodiscard]] std::int64_t whole(const Entry& entry) const;
  [[nodiscard]] std::vector<std::int64_t> wholes(const Entry& entry) const;
  [[nodiscard]] std::vector<std::string> texts(const Entry& entry) const;
  [[nodiscard]] When when(const Entry& entry) const;
  [[nodiscard]] const toml::table& table(const Entry& entry) const;
  /// The tables of a list; not empty.
  [[nodiscard]] std::vector<const toml::table*> tables(const Entry& entry) const;

  // The same for optional keys.
  [[nodiscard]] std::string text_or_empty(std::string_view name) const;
  [[nodiscard]] std::optional<Number> optional_number(std::string_view name) const;
  [[nodiscard]] std::optional<When> optional_when() const;

 private:
  const Source& source_;
  Place place_;
  std::vector<Entry> entries_;
};

/// Formats a value for messages: on one line, shortened if long.
[[nodiscard]] std::string shown(const toml::node& node);
/// "a whole number", "a table", ...
[[nodiscard]] std::string_view kind_of(const toml::node& node);

/// Reads a number of the field's quantity and range, by the rules for units.
/// @param what the key, for messages
/// @param unit_is_named true if the key's name gives the unit
[[nodiscard]] Number read_number(const Source& source, const toml::node& node, const Field& field,
                                 std::string_view what, bool unit_is_named);

/// Reads the profile of `entry`. Adds the files that it names to `files`.
[[nodiscard]] ProfileScript read_profile_script(const Source& source, const Entry& entry, const FileReader& read_file,
                                                std::map<std::string, std::string>& files);

/// Reads the end conditions of a phase from its `until` table.
[[nodiscard]] std::vector<ConditionScript> read_until(const Source& source, const toml::table& table, Place place);

/// Reads [series] and [vary].
[[nodiscard]] SeriesScript read_series(const Source& source, const TableReader& root);
/// False for the keys that say who runs a script, and on what.
[[nodiscard]] bool script_may_set(std::string_view key) noexcept;
/// Reads [settings].
[[nodiscard]] std::vector<Setting> read_settings(const Source& source, const TableReader& root);

}  // namespace abs_hil::config
