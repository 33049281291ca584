// Faults as text, the same for every emulated board: "NAME" or "NAME=NUMBER".

#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

/// Throws the error of every emulator for an unknown fault.
[[noreturn]] inline void refuse_fault(std::string_view text, std::string_view valid) {
  throw std::invalid_argument("fault \"" + std::string(text) + "\": give " + std::string(valid));
}

/// A fault by its name, which "=WHAT" follows if it takes a number.
struct FaultName {
  std::string_view usage;
  double least{0.0};
  double most{0.0};
  bool whole{false};  ///< the number is an integer

  [[nodiscard]] std::string_view name() const { return usage.substr(0, usage.find('=')); }
  [[nodiscard]] bool takes_number() const { return usage.find('=') != std::string_view::npos; }
};

/// A fault as a user gave it: its place in the table of names, and its number, 0 if it takes none.
struct GivenFault {
  std::size_t place{0};
  double number{0.0};
};
/// The fault of the table that `text` names. Throws std::invalid_argument with `whole`, the text as the user gave it,
/// `valid`, and the table.
[[nodiscard]] inline GivenFault fault_in(std::string_view text, std::span<const FaultName> names,
                                         std::string_view whole, std::string_view valid, std::string_view between) {
  const std::size_t equals = text.find('=');
  for (std::size_t place = 0; place < names.size(); ++place) {
    const FaultName& name = names[place];
    if (name.name() != text.substr(0, equals) || name.takes_number() != (equals != std::string_view::npos)) continue;
    if (!name.takes_number()) return {place};
    const std::string_view digits = text.substr(equals + 1);
    const auto number = rig::parse_number<double>(digits);
    const bool fits = number && *number >= name.least && *number <= name.most;
    if (fits && (!name.whole || rig::parse_number<unsigned>(digits))) return {place, *number};
  }
  std::string all;
  for (const FaultName& name : names) all.append(all.empty() ? "" : between).append(name.usage);
  refuse_fault(whole, std::string(valid) + all);
}
[[nodiscard]] inline GivenFault fault_in(std::string_view text, std::span<const FaultName> names) {
  return fault_in(text, names, text, "one of ", " ");
}

}  // namespace abs_hil::emulator
