#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace abs_hil::analysis {

/// A number as JSON; null for NaN and infinity, which JSON lacks.
[[nodiscard]] inline nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace abs_hil::analysis
