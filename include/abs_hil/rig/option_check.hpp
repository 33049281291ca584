#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "abs_hil/rig/option.hpp"

namespace abs_hil::rig {

/// The valid values of an option, for errors: "a number in (0, 1]", "one of a, b".
[[nodiscard]] std::string valid_number_text(const OptionFacts& facts, bool whole);
[[nodiscard]] std::string valid_name_text(const OptionFacts& facts);
/// "NAME = VALUE is not valid; give VALID UNIT (MEANING)".
[[nodiscard]] std::string refusal(std::string_view name, std::string_view value, std::string_view valid,
                                  const OptionFacts& facts);

/// Throws std::invalid_argument, naming option, value and range, unless the row allows the value.
void require_valid(std::string_view name, const OptionFacts& facts, double value);
void require_valid(std::string_view name, const OptionFacts& facts, std::string_view text);

/// Throws std::invalid_argument unless the rows allow the values of all options, including those of groups.
/// @param prefix of the keys, as in "control.adaptive_peak."
template <class Options>
void require_valid(const Options& options, const std::string& prefix) {
  for_each_option(options, prefix, [](const std::string& name, const OptionFacts& facts, const auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, std::string>) {
      require_valid(name, facts, std::string_view(value));
    } else if constexpr (!std::is_same_v<Value, bool>) {
      require_valid(name, facts, static_cast<double>(value));
    }
  });
}

/// The same for one option of `Options`, not of a group.
template <class Options>
void require_valid(const Options& options, double Options::*member, const std::string& prefix) {
  for_each_row<Options>([&](const auto& row) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(row)>, OptionRow<Options, double>>) {
      if (row.member == member) require_valid(prefix + std::string(row.facts.key), row.facts, options.*member);
    }
  });
}

/// True if this value of an option weakens the protection of a run on a board.
template <class Value>
[[nodiscard]] bool weakens(const OptionFacts& facts, const Value& value) {
  if constexpr (std::is_same_v<Value, bool>) {
    return facts.safety.weakened_by(std::string_view(value ? "true" : "false"));
  } else if constexpr (std::is_same_v<Value, std::string>) {
    return facts.safety.weakened_by(std::string_view(value));
  } else {
    return facts.safety.weakened_by(static_cast<double>(value));
  }
}

}  // namespace abs_hil::rig
