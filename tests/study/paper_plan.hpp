#pragma once

#include "study/study.hpp"

namespace abs_hil::study::test {

/// Braking at once from 170 rad/s on the plant of Table 1.
inline config::Settings paper_settings() {
  config::Settings settings;
  settings.experiment.start_speed_rad_s = 170.0;
  return settings;
}

/// A comparison of controllers on `repeat` varied plants.
inline Study paper_study(std::vector<std::string> controllers, std::uint64_t repeat,
                         Variation variation = Variation::standard(), std::uint64_t seed = 3) {
  const config::Settings settings = paper_settings();
  return {{.controllers = std::move(controllers),
           .repeat = {.runs = repeat, .seed = seed, .variation = variation},
           .path = "test"},
          {{.plant = settings.plant_name, .experiment = settings.experiment.name, .settings = settings}}};
}

}  // namespace abs_hil::study::test
