// The keys of a table as a file may spell them, and the units of its numbers.
#include "config/grammar.hpp"

#include <charconv>
#include <cmath>
#include <numbers>

namespace abs_hil::config {

namespace {

struct Unit {
  std::string_view si_unit;
  std::string_view name;
  double si;  ///< of one such unit
};

constexpr std::array<Unit, 14> units{{
    {"", "%", 0.01},
    {"s", "s", 1.0},
    {"s", "ms", 1e-3},
    {"s", "min", 60.0},
    {"rad/s", "rad/s", 1.0},
    {"rad/s", "rpm", std::numbers::pi / 30.0},
    {"m/s", "m/s", 1.0},
    {"m/s", "km/h", 1.0 / 3.6},
    {"m", "m", 1.0},
    {"m", "cm", 1e-2},
    {"m", "mm", 1e-3},
    {"N m", "N m", 1.0},
    {"N m", "Nm", 1.0},
    {"N m", "mN m", 1e-3},
}};

}  // namespace

const Field* Grammar::find(std::string_view name) const noexcept {
  const auto at = std::ranges::find_if(fields, [name](const Field& field) {
    if (!name.starts_with(field.facts.key)) return false;
    const std::string_view rest = name.substr(field.facts.key.size());
    return rest.empty() || rest == suffix_of(field.facts.unit);
  });
  return at == fields.end() ? nullptr : &*at;
}

std::vector<std::string> Grammar::spellings() const {
  std::vector<std::string> names;
  for (const Field& field : fields) {
    names.emplace_back(field.facts.key);
    if (!field.facts.unit.empty()) names.push_back(names.back() + suffix_of(field.facts.unit));
  }
  return names;
}

std::string table_below_with(const Grammar& start, std::string_view key) {
  // Breadth first: the nearest table counts. The grammar of `until` contains itself, so no grammar is taken twice.
  std::vector<std::pair<const Grammar*, std::string>> open{{&start, ""}};
  for (std::size_t n = 0; n < open.size(); ++n) {
    const auto [grammar, path] = open[n];
    for (const Field& field : grammar->fields) {
      const Grammar* below = field.grammar == nullptr ? nullptr : &field.grammar();
      const auto is_it = [below](const auto& other) { return other.first == below; };
      if (below == nullptr || std::ranges::any_of(open, is_it)) continue;
      std::string name = path + (path.empty() ? "" : ".") + std::string(field.facts.key);
      if (below->find(key) != nullptr) return name;
      open.emplace_back(below, std::move(name));
    }
  }
  return {};
}

std::string suffix_of(std::string_view unit) {
  std::string suffix(unit.empty() ? "" : "_");
  for (const char c : unit) {
    if (c != ' ') suffix += c == '/' ? '_' : c;
  }
  return suffix;
}

std::string units_text(std::string_view unit) {
  std::string text;
  for (const Unit& known : units) {
    if (known.si_unit == unit) text.append(text.empty() ? "" : ", ").append(known.name);
  }
  return text;
}

std::optional<double> parse_quantity(std::string_view text, std::string_view unit) noexcept {
  double number = 0.0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc()) return std::nullopt;
  std::string_view name(at, static_cast<std::size_t>(end - at));
  while (name.starts_with(' ')) name.remove_prefix(1);
  for (const Unit& known : units) {
    // 20 / 1000 rounds once; 20 * 0.001 rounds twice, because 0.001 is not exact.
    if (known.si_unit == unit && known.name == name) {
      const double divisor = std::round(1.0 / known.si);
      return known.si < 1.0 && divisor * known.si == 1.0 ? number / divisor : number * known.si;
    }
  }
  return std::nullopt;
}

}  // namespace abs_hil::config
