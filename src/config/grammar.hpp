#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "config/key_table.hpp"

namespace abs_hil::config {

/// The quantity that a number measures. A script gives its unit in the key's name (`lasts_s = 2`) or after the number
/// (`lasts = "2 s"`). The parser never guesses a unit.
enum class Quantity : std::uint8_t { none, time, angular_speed, speed, distance, torque };

/// The SI unit as the configuration keys write it: "rad/s"; empty for pure numbers.
[[nodiscard]] std::string_view unit_of(Quantity quantity) noexcept;
/// The suffix of a key's name that gives this unit: "_rad_s"; empty for pure numbers.
[[nodiscard]] std::string_view suffix_of(Quantity quantity) noexcept;
/// The units that a number may have, as a list: "s, ms, min" for a time.
[[nodiscard]] std::string units_text(Quantity quantity);
/// Reads a number with its unit, "20 ms", and converts it to SI units. Returns nothing if the text has another form.
/// The only unit of pure numbers is "%".
[[nodiscard]] std::optional<double> parse_quantity(std::string_view text, Quantity quantity) noexcept;

/// The form of a field's value.
enum class Shape : std::uint8_t {
  text,       ///< any text
  choice,     ///< one of `allowed`
  flag_true,  ///< `true` alone
  number,     ///< a number with its quantity, or "$key" for a configuration value
  whole,      ///< a whole number
  texts,      ///< a list of texts
  wholes,     ///< a list of whole numbers
  condition,  ///< "KEY = VALUE" over the configuration
  profile,    ///< a number, or a table with a profile over the time of the phase
  motor,      ///< "off" or a profile of duties
  brake,      ///< "off", "controller" or a table
  table,      ///< a table of `grammar`
  tables,     ///< a list of such tables
  points,     ///< [[time, value], ...]
  settings,   ///< configuration values, nested or with dotted names
  grid,       ///< configuration values, each a list or a {from, to, steps}
};

struct Grammar;

/// One key of a table.
struct Field {
  rig::OptionFacts facts;  ///< key without the unit's suffix; range in SI units; names that a choice may be
  Shape shape;
  Quantity quantity{Quantity::none};
  const Grammar* grammar{nullptr};  ///< of tables
  bool required{false};
};

/// One kind of table. The parser, its errors and the schema all use it.
struct Grammar {
  std::string_view title;  ///< its name in errors: "[[phase]]"
  std::string_view meaning;
  std::vector<Field> fields;

  [[nodiscard]] const Field* find(std::string_view name) const noexcept;
  /// All valid spellings: names with and without the unit's suffix.
  [[nodiscard]] std::vector<std::string> spellings() const;
};

/// The path from `start` down to the table that knows the key, "until" or "brake.slip_ref"; empty if none does.
[[nodiscard]] std::string table_below_with(const Grammar& start, std::string_view key);

[[nodiscard]] const Grammar& script_grammar();
[[nodiscard]] const Grammar& phase_grammar();
[[nodiscard]] const Grammar& until_grammar();
[[nodiscard]] const Grammar& brake_grammar();
[[nodiscard]] const Grammar& profile_grammar();
[[nodiscard]] const Grammar& limits_grammar();
[[nodiscard]] const Grammar& event_grammar();
[[nodiscard]] const Grammar& series_grammar();
[[nodiscard]] const Grammar& steps_grammar();

}  // namespace abs_hil::config
