#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "config/script.hpp"

namespace abs_hil::config {

/// One run of a series: what it differs in.
struct SeriesMember {
  std::vector<std::pair<std::string, config::Value>> varied{};  ///< in the order of [vary]
  std::int64_t seed{0};
};

/// The runs of a series, in order: every combination of what varies, the last key fastest, each with all its seeds. The
/// k-th repetition of every combination has the same seed, so that combinations meet the same chance.
/// @param seed of the first repetition where the script names none
[[nodiscard]] std::vector<SeriesMember> members_of(const SeriesScript& series, std::int64_t seed);

/// A value as --set takes it.
[[nodiscard]] std::string text_of(const config::Value& value);

}  // namespace abs_hil::config
