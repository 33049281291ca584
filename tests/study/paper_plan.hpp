#pragma once

#include "study/comparison.hpp"

namespace abs_hil::study::test {

/// Braking at once from 170 rad/s on the plant of Table 1.
inline config::Settings paper_settings() {
  config::Settings settings;
  settings.experiment.start_speed_rad_s = 170.0;
  return settings;
}

inline ComparisonPlan paper_plan(std::vector<std::string> controllers, std::size_t repeat) {
  return {.settings = paper_settings(),
          .controllers = std::move(controllers),
          .repeat = repeat,
          .seed = 3,
          .variation = Variation::standard(),
          .threads = 1};
}

}  // namespace abs_hil::study::test
