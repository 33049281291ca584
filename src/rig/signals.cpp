// Checks of the names that a controller gives its own signals.
#include "abs_hil/rig/signals.hpp"

#include <algorithm>
#include <stdexcept>

#include "abs_hil/rig/quantities.hpp"

namespace abs_hil::rig {

namespace {

constexpr std::size_t name_max = 32;

// Not std::isalpha, which depends on the locale.
bool is_letter(char c) noexcept { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_of_name(char c) noexcept { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; }

[[noreturn]] void refuse(std::string_view name, const char* why) {
  throw std::invalid_argument("the controller's signal '" + std::string(name) + "' " + why);
}

}  // namespace

bool is_signal_name(std::string_view name) noexcept {
  return !name.empty() && name.size() <= name_max && is_letter(name.front()) && std::ranges::all_of(name, is_of_name) &&
         !is_quantity(name);
}

std::vector<std::string> signal_names(std::span<const Signal> signals) {
  if (signals.size() > signal_max) {
    throw std::invalid_argument("the controller has " + std::to_string(signals.size()) + " signals; give at most " +
                                std::to_string(signal_max));
  }
  std::vector<std::string> names;
  for (const Signal& signal : signals) {
    const std::string_view name = signal.name;
    if (is_quantity(name)) refuse(name, "has the name of a quantity of every run; choose another name");
    if (!is_signal_name(name)) {
      refuse(name, "has no valid name; give letters, digits and '_', a letter first, at most 32 characters");
    }
    if (std::ranges::find(names, name) != names.end()) refuse(name, "occurs twice; choose another name");
    names.emplace_back(name);
  }
  return names;
}

}  // namespace abs_hil::rig
