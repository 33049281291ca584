#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "config/script.hpp"

namespace abs_hil::config {

/// One run of a series: its varied values and its seed.
struct SeriesMember {
  std::vector<std::pair<std::string, config::Value>> varied{};  ///< in the order of [vary]
  std::int64_t seed{0};
};

/// The runs of a series, in order: all combinations of the varied values, the last key fastest, each with all seeds.
/// The k-th repetitions of all combinations have the same seed, so that the combinations meet the same noise.
/// @param seed of the first repetition if the script gives none
[[nodiscard]] std::vector<SeriesMember> members_of(const SeriesScript& series, std::int64_t seed);

/// Formats a value as --set takes it.
[[nodiscard]] std::string text_of(const config::Value& value);

}  // namespace abs_hil::config
