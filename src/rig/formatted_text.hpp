#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

namespace abs_hil::rig {

/// Formats text of any length as printf does. `format` must be a literal that fits the values. Not real-time safe.
template <typename... Values>
[[nodiscard]] std::string formatted(const char* format, Values... values) {
  const int size = std::snprintf(nullptr, 0, format, values...);
  std::string text(static_cast<std::size_t>(size > 0 ? size : 0), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text;
}

}  // namespace abs_hil::rig
