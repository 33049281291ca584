#pragma once

#include <charconv>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace abs_hil::emulator {

/// Throws the error of every emulator for an unknown fault.
[[noreturn]] inline void refuse_fault(std::string_view text, std::string_view valid) {
  throw std::invalid_argument("fault \"" + std::string(text) + "\": give " + std::string(valid));
}

/// Parses all of `text` as a number; `base` (2 to 36) is only for integers.
template <typename Number, typename... Base>
[[nodiscard]] std::optional<Number> number_in(std::string_view text, Base... base) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, value, base...);
  return error == std::errc() && at == end ? std::optional(value) : std::nullopt;
}

}  // namespace abs_hil::emulator
