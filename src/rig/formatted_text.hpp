#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>

namespace abs_hil::rig {

/// Formats text of any length as printf does. `format` must be a literal that fits the values. Not real-time safe.
template <typename... Values>
[[nodiscard]] std::string formatted(const char* format, Values... values) {
  const int size = std::snprintf(nullptr, 0, format, values...);
  std::string text(static_cast<std::size_t>(size > 0 ? size : 0), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text;
}

/// `text` of somebody else for logs and terminals: at most `max_bytes`, with '?' for control and non-ASCII bytes, so
/// that it writes no line of ours. Not real-time safe.
[[nodiscard]] inline std::string printable(std::string_view text, std::size_t max_bytes) {
  std::string clean(text.substr(0, max_bytes));
  for (char& c : clean) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  if (text.size() > max_bytes) clean += "...";
  return clean;
}

}  // namespace abs_hil::rig
