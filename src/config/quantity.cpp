#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "config/grammar.hpp"

namespace abs_hil::config {

namespace {

struct Unit {
  Quantity quantity;
  std::string_view name;
  double si;  ///< of one such unit
};

constexpr std::array<Unit, 14> units{{
    {Quantity::none, "%", 0.01},
    {Quantity::time, "s", 1.0},
    {Quantity::time, "ms", 1e-3},
    {Quantity::time, "min", 60.0},
    {Quantity::angular_speed, "rad/s", 1.0},
    {Quantity::angular_speed, "rpm", std::numbers::pi / 30.0},
    {Quantity::speed, "m/s", 1.0},
    {Quantity::speed, "km/h", 1.0 / 3.6},
    {Quantity::distance, "m", 1.0},
    {Quantity::distance, "cm", 1e-2},
    {Quantity::distance, "mm", 1e-3},
    {Quantity::torque, "N m", 1.0},
    {Quantity::torque, "Nm", 1.0},
    {Quantity::torque, "mN m", 1e-3},
}};

}  // namespace

std::string_view unit_of(Quantity quantity) noexcept {
  switch (quantity) {
    case Quantity::none: return "";
    case Quantity::time: return "s";
    case Quantity::angular_speed: return "rad/s";
    case Quantity::speed: return "m/s";
    case Quantity::distance: return "m";
    case Quantity::torque: return "N m";
  }
  return "";
}

std::string_view suffix_of(Quantity quantity) noexcept {
  switch (quantity) {
    case Quantity::none: return "";
    case Quantity::time: return "_s";
    case Quantity::angular_speed: return "_rad_s";
    case Quantity::speed: return "_m_s";
    case Quantity::distance: return "_m";
    case Quantity::torque: return "_Nm";
  }
  return "";
}

std::string units_text(Quantity quantity) {
  std::string text;
  for (const Unit& unit : units) {
    if (unit.quantity != quantity) continue;
    text += (text.empty() ? "" : ", ") + std::string(unit.name);
  }
  return text;
}

std::optional<double> parse_quantity(std::string_view text, Quantity quantity) noexcept {
  double number = 0.0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc()) return std::nullopt;
  std::string_view unit(at, static_cast<std::size_t>(end - at));
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  for (const Unit& known : units) {
    // 20 / 1000 rounds once; 20 * 0.001 rounds twice, because 0.001 is not exact.
    if (known.quantity == quantity && known.name == unit) {
      const double divisor = std::round(1.0 / known.si);
      return known.si < 1.0 && divisor * known.si == 1.0 ? number / divisor : number * known.si;
    }
  }
  return std::nullopt;
}

}  // namespace abs_hil::config
