#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace abs_hil::rig {

/// Texts of JSON and TOML may nest their values this deep. Libraries and our own code walk through such values by
/// recursion, so a deeper text could exhaust the stack. Real ones have less than ten levels.
inline constexpr int nesting_max = 64;
/// A name in TOML may have this many parts: each makes a table within a table.
inline constexpr int name_parts_max = 16;

/// Place of the first bracket of a JSON text that lies deeper than `nesting_max`; none if the text is flat enough. One
/// pass over the text, without recursion; the text need not be valid.
[[nodiscard]] std::optional<std::size_t> too_deep_json(std::string_view text) noexcept;

struct TooDeepToml {
  std::size_t offset{0};
  std::size_t line{1};
  bool name{false};  ///< a name of too many parts; otherwise a bracket
};
/// The same for TOML. Names with dots nest as brackets do.
[[nodiscard]] std::optional<TooDeepToml> too_deep_toml(std::string_view text) noexcept;

}  // namespace abs_hil::rig
