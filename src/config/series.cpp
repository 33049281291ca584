#include "config/series.hpp"

#include <fmt/format.h>

namespace abs_hil::config {

std::vector<SeriesMember> members_of(const SeriesScript& series, std::int64_t seed) {
  std::vector<std::int64_t> seeds = series.seeds;
  if (seeds.empty()) {
    for (std::int64_t k = 0; k < series.repeat; ++k) seeds.push_back(series.seed.value_or(seed) + k);
  }
  std::vector<SeriesMember> combinations(1);
  for (const Varied& varied : series.vary) {
    std::vector<SeriesMember> longer;
    for (const SeriesMember& shorter : combinations) {
      for (const config::Value& value : varied.values) {
        longer.push_back(shorter);
        longer.back().varied.emplace_back(varied.key, value);
      }
    }
    combinations = std::move(longer);
  }
  std::vector<SeriesMember> members;
  for (const SeriesMember& combination : combinations) {
    for (const std::int64_t own : seeds) {
      members.push_back(combination);
      members.back().seed = own;
    }
  }
  return members;
}

std::string text_of(const config::Value& value) {
  return std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
}

}  // namespace abs_hil::config
