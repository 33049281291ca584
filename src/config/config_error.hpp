#pragma once

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace abs_hil::config {

/// A text that may hold anything, fit for a terminal: control characters but the line's end as \xNN, and not too long.
[[nodiscard]] inline std::string printable(const std::string& text) {
  constexpr std::size_t most = 4000;
  std::string shown;
  for (const char c : text.substr(0, most)) {
    std::array<char, 5> code{c};
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n') || byte == 0x7F) std::snprintf(code.data(), code.size(), "\\x%02x", byte);
    shown += code.data();
  }
  return text.size() > most ? shown + " ..." : shown;
}

/// The configuration cannot be used. The message is one line. It names the thing, the value, what is valid and where
/// the value came from. The program then ends with status 2, before anything has moved.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(const std::string& what) : std::runtime_error(printable(what)) {}
};

}  // namespace abs_hil::config
