// Any lines of `key=value`: each is refused with a ConfigError or leaves every number within its range.
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>
#include <type_traits>
#include <variant>

#include "abs_hil/plant_sim/factor_profile.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "fuzz_input.hpp"

namespace {

using abs_hil::fuzz::expect;

void expect_in_range(const abs_hil::config::KeyTable& table) {
  for (const abs_hil::config::Key& key : table.keys()) {
    std::visit(
        [&](const auto* value) {
          using Number = std::remove_cvref_t<decltype(*value)>;
          if constexpr (std::is_arithmetic_v<Number> && !std::is_same_v<Number, bool>) {
            expect(key.range.contains(static_cast<double>(*value)));
          }
        },
        key.target);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  abs_hil::config::Settings settings;
  abs_hil::config::KeyTable table(settings);
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(line.size() < text.size() ? line.size() + 1 : text.size());
    try {
      table.set_text(line, "fuzz");
    } catch (const abs_hil::config::ConfigError&) {
    }
    try {
      const abs_hil::plant_sim::FactorProfile profile(line);
      expect(profile.highest() > 0.0 && profile.highest() <= 10.0 && !profile.pieces().empty());
    } catch (const std::invalid_argument&) {
    }
  }
  expect_in_range(table);
  static_cast<void>(table.to_json().dump());  // throws for text that is not UTF-8
  return 0;
}
