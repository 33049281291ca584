#pragma once

#include <toml++/toml.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/grammar.hpp"
#include "config/script.hpp"

// Reads the tables of experiment and study files into the structs whose rows describe them.

namespace abs_hil::config {

[[nodiscard]] inline Place place_of(const toml::source_region& region) noexcept {
  return {region.begin.line, region.begin.column};
}

/// The file that is read: its path, for errors, the configuration keys, for look-ups, and the files that it names.
class Source {
 public:
  explicit Source(std::string path, FileReader read_file = {})
      : path_(std::move(path)), read_file_(std::move(read_file)), keys_(settings_) {}
  [[noreturn]] void fail(Place place, std::string_view message) const;
  [[nodiscard]] std::string at(Place place) const;
  /// Returns the configuration key of that name. Fails for an unknown name, with the nearest known one.
  [[nodiscard]] const Key& key(std::string_view name, Place place) const;
  /// True for a configuration key, and for a table of them, as in "control".
  [[nodiscard]] bool is_setting(std::string_view name) const;
  /// Fails unless the configuration key takes that value.
  void check_value(std::string_view name, const Value& value, Place place) const;
  /// The text as TOML. Fails where it is none.
  [[nodiscard]] toml::table parsed(const std::string& text) const;
  /// The text of a file that the script names; empty if there is none. It is kept.
  [[nodiscard]] std::optional<std::string> named_file(const std::string& name) const;
  [[nodiscard]] const std::map<std::string, std::string>& named_files() const noexcept { return files_; }

 private:
  std::string path_;
  FileReader read_file_;
  mutable std::map<std::string, std::string> files_{};
  mutable Settings settings_{};
  mutable KeyTable keys_;
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

/// The keys of one table. The constructor refuses unknown and missing keys. The other members read values; they fail
/// for a value that its row does not allow.
class TableReader {
 public:
  /// @param place where the table stands if TOML does not say
  TableReader(const Source& source, const toml::table& table, const Grammar& grammar, Place place);

  [[nodiscard]] const Source& source() const noexcept { return source_; }
  [[nodiscard]] const Entry* find(std::string_view name) const noexcept;
  /// In the order of the file.
  [[nodiscard]] const std::vector<Entry>& entries() const noexcept { return entries_; }
  [[nodiscard]] Place place() const noexcept { return place_; }
  [[noreturn]] void fail(Place place, std::string_view message) const { source_.fail(place, message); }

  // Reads a value of any type that a member of a table may have.
  void read(const Entry& entry, std::string& text) const;
  void read(const Entry& entry, bool& flag) const;      ///< must be true
  void read(const Entry& entry, double& number) const;  ///< no $key
  void read(const Entry& entry, Number& number) const;
  void read(const Entry& entry, std::vector<std::int64_t>& wholes) const;
  void read(const Entry& entry, std::vector<std::string>& texts) const;
  void read(const Entry& entry, When& when) const;
  void read(const Entry& entry, ProfileScript& profile) const;
  void read(const Entry& entry, std::vector<ConditionScript>& conditions) const;
  void read(const Entry& entry, std::vector<Setting>& settings) const;
  void read(const Entry& entry, std::vector<Factor>& factors) const;
  template <class Member>
  void read(const Entry& entry, Member& member) const;
  template <class Value>
  [[nodiscard]] Value get(const Entry& entry) const {
    Value value{};
    read(entry, value);
    return value;
  }

  [[nodiscard]] std::int64_t whole(const Entry& entry) const;
  [[nodiscard]] const toml::table& table(const Entry& entry) const;
  /// The tables of a list; not empty.
  [[nodiscard]] std::vector<const toml::table*> tables(const Entry& entry) const;
  /// True if the value is one of the texts that the row allows in place of a profile or a table.
  [[nodiscard]] static bool is_allowed_text(const Entry& entry) noexcept;

 private:
  const Source& source_;
  Place place_;
  std::vector<Entry> entries_;
};

/// Reads a table. Rules over several keys are those of `T::check(reader)`, if it has one.
template <class T>
void read_table(const Source& source, const toml::table& table, Place place, T& value) {
  const TableReader reader(source, table, grammar_of<T>(), place);
  if constexpr (requires { value.place; }) value.place = reader.place();
  rig::for_each_row<T>([&](const auto& row) {
    if (const Entry* entry = reader.find(row.facts.key)) reader.read(*entry, value.*row.member);
  });
  if constexpr (requires { value.check(reader); }) value.check(reader);
}

template <class Member>
void TableReader::read(const Entry& entry, Member& member) const {
  using Element = typename ElementOf<Member>::type;
  if constexpr (std::is_enum_v<Member>) {
    const auto word = get<std::string>(entry);
    member = std::ranges::find(words_of<Member>, word, [](const auto& row) { return row.first; })->second;
  } else if constexpr (std::is_integral_v<Member>) {
    member = static_cast<Member>(whole(entry));
  } else if constexpr (Table<Element>) {
    for (const toml::table* one : tables(entry)) read_table(source_, *one, entry.place, member.emplace_back());
  } else if constexpr (Table<Member>) {
    if constexpr (requires { member.word; }) {
      if (is_allowed_text(entry)) {
        read(entry, member.word);
        return;
      }
    }
    read_table(source_, table(entry), entry.place, member);
  } else {  // an optional value; "off" leaves it empty
    if (!is_allowed_text(entry) || !std::is_same_v<typename Member::value_type, ProfileScript>)
      read(entry, member.emplace());
  }
}

/// Formats a value for messages: on one line, shortened if long.
[[nodiscard]] std::string shown(const toml::node& node);
/// Reads a number with the unit and the range of the row.
/// @param what the key, for messages
/// @param unit_is_named true if the key's name gives the unit
[[nodiscard]] Number read_number(const Source& source, const toml::node& node, const rig::OptionFacts& facts,
                                 std::string_view what, bool unit_is_named);
/// A configuration value as TOML holds it; nothing for what is none.
[[nodiscard]] std::optional<Value> value_in(const toml::node& node);
/// Calls `visit(dotted name, place of the name, node)` for each value below a table of configuration keys. A table
/// for which `is_value` is true is a value.
template <class IsValue, class Visit>
void for_each_value(const toml::table& table, const std::string& prefix, const IsValue& is_value, const Visit& visit) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + (prefix.empty() ? "" : ".") + std::string(name.str());
    const auto* inner = node.as_table();
    if (inner != nullptr && !is_value(*inner)) {
      for_each_value(*inner, key, is_value, visit);
    } else {
      visit(key, place_of(name.source()), node);
    }
  }
}

}  // namespace abs_hil::config
