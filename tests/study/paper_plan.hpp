#pragma once

#include "study/compute.hpp"
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

/// The runs of a study, by their number.
inline std::vector<RunResult> runs_of(const Study& study, std::size_t threads = 1) {
  std::vector<RunResult> runs(study.runs());
  run_part(
      study, study.runs(), threads, [](std::size_t index) { return index; },
      [&runs](std::size_t index, const Outcome& outcome) { runs[index] = outcome.run; });
  return runs;
}

}  // namespace abs_hil::study::test
