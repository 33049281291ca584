// Ranges, allowed names and safety classes of options, in words.
#include "abs_hil/rig/option.hpp"

#include <charconv>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::rig {

namespace {

/// The shortest text that reads back to the same number. Only very large and very small numbers have an exponent.
std::string number_text(double value) {
  const double size = std::abs(value);
  const bool plain = value == 0.0 || (size >= 1e-4 && size < 1e16);
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value,
                                          plain ? std::chars_format::fixed : std::chars_format::scientific);
  return error == std::errc() ? std::string(text.data(), end) : std::string("?");
}

}  // namespace

std::string Range::text() const {
  return (least_open ? '(' : '[') + number_text(least) + ", " + number_text(most) + (most_open ? ')' : ']');
}

std::vector<std::string_view> AllowedNames::list() const {
  std::vector<std::string_view> names;
  for (std::size_t index = 0; !at(index).empty(); ++index) names.push_back(at(index));
  return names;
}

bool AllowedNames::contains(std::string_view name) const noexcept {
  if (empty()) return true;
  for (std::size_t index = 0; !at(index).empty(); ++index) {
    if (at(index) == name) return true;
  }
  return false;
}

std::string SafetyClass::in_words(std::string_view unit) const {
  const std::string number = number_text(bound) + (unit.empty() ? "" : ' ' + std::string(unit));
  const std::string value = text.data() == nullptr ? number : text.empty() ? "empty" : std::string(text);
  switch (kind) {
    case Kind::unclassed: return "not classed";
    case Kind::none: return "no effect";
    case Kind::above: return "weakens above " + value;
    case Kind::below: return "weakens below " + value;
    case Kind::unless: return "weakens unless " + value;
    case Kind::text: return "weakens if " + value;
    case Kind::commissioned: return "fixed by the commissioning record";
    case Kind::elsewhere: return "judged by a rule of its own";
    case Kind::consent: return "a person's consent";
  }
  return {};
}

std::string valid_number_text(const OptionFacts& facts, bool whole) {
  return std::string(whole ? "a whole number in " : "a number in ") + facts.range.text();
}

std::string valid_name_text(const OptionFacts& facts) {
  std::string text;
  for (const std::string_view name : facts.allowed.list()) text.append(text.empty() ? "one of " : ", ").append(name);
  bool first = true;
  for (const std::string_view ending : facts.files.endings) {
    if (ending.empty()) continue;
    text.append(std::exchange(first, false) ? ", or a file " : " or ").append(ending.starts_with('.') ? "*" : "");
    text.append(ending);
  }
  return text.empty() ? "text" : text;
}

std::string refusal(std::string_view name, std::string_view value, std::string_view valid, const OptionFacts& facts) {
  std::string text(name);
  text.append(" = ").append(value).append(" is not valid; give ").append(valid);
  if (!facts.unit.empty()) text.append(" ").append(facts.unit);
  return text.append(" (").append(facts.meaning).append(")");
}

void require_valid(std::string_view name, const OptionFacts& facts, double value) {
  if (facts.range.contains(value)) return;
  throw std::invalid_argument(refusal(name, number_text(value), valid_number_text(facts, false), facts));
}

void require_valid(std::string_view name, const OptionFacts& facts, std::string_view text) {
  if (facts.allows(text)) return;
  throw std::invalid_argument(refusal(name, '"' + std::string(text) + '"', valid_name_text(facts), facts));
}

}  // namespace abs_hil::rig
