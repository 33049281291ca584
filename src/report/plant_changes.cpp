#include "plant_changes.hpp"

#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "abs_hil/plant_sim/factor_profile.hpp"

namespace abs_hil::report {

namespace {

using plant_sim::FactorProfile;

constexpr std::array<std::pair<const char*, const char*>, 5> profiles{{
    {"plant.friction_profile", "friction"},
    {"plant.brake_torque_profile", "brake torque"},
    {"plant.motor_torque_profile", "motor torque"},
    {"plant.upper_bearing_profile", "upper bearing"},
    {"plant.lower_bearing_profile", "lower bearing"},
}};

void add_changes(const FactorProfile& profile, const char* what, const RunSurvey& survey,
                 std::vector<PlantChange>& changes) {
  if (profile.axis() != FactorProfile::Axis::time || (profile.from_braking() && !survey.brakes())) return;
  const double zero_s = profile.from_braking() ? survey.brake_from_s : 0.0;
  for (std::size_t i = 1; i < profile.pieces().size(); ++i) {
    const FactorProfile::Piece& piece = profile.pieces()[i];
    const double time_s = zero_s + piece.begin;
    if (time_s > survey.to_s) return;
    changes.push_back(
        {time_s, piece.slope == 0.0 ? fmt::format("{} × {:.3g}", what, piece.value) : fmt::format("{} drifts", what)});
  }
}

}  // namespace

std::vector<PlantChange> plant_changes(const RunFiles& run, const RunSurvey& survey) {
  std::vector<PlantChange> changes;
  for (const auto& [key, what] : profiles) {
    const auto text = run.config.find(key);
    if (text == run.config.end()) continue;
    try {
      add_changes(FactorProfile(text->second, key), what, survey, changes);
    } catch (const std::invalid_argument&) {
      // Another version's or a hand's: the run is worth showing without its marks.
    }
  }
  return changes;
}

}  // namespace abs_hil::report
