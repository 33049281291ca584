#include "plant_changes.hpp"

#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <utility>

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

std::string label_of(const std::string& what, const FactorProfile::Piece& piece) {
  return piece.slope == 0.0 ? fmt::format("{} × {:.3g}", what, piece.value) : fmt::format("{} drifts", what);
}

}  // namespace

PlantChangeFinder::PlantChangeFinder(const RunFiles& run) {
  for (const auto& [key, what] : profiles) {
    const auto text = run.config.find(key);
    if (text == run.config.end()) continue;
    try {
      courses_.push_back({.what = what, .profile = FactorProfile(text->second, key)});
    } catch (const std::invalid_argument&) {
      // Another version's or a hand's: the run is worth showing without its marks.
    }
  }
}

void PlantChangeFinder::see(double time_s, bool braking, double road_speed_m_s) {
  if (std::exchange(started_, true)) rolled_m_ += 0.5 * (time_s - last_time_s_) * (last_speed_m_s_ + road_speed_m_s);
  last_time_s_ = time_s;
  last_speed_m_s_ = road_speed_m_s;
  for (Course& course : courses_) {
    if (!course.counting && (braking || !course.profile.from_braking())) {
      course.counting = true;
      if (course.profile.from_braking()) {
        course.origin = course.profile.axis() == FactorProfile::Axis::time ? time_s : rolled_m_;
      }
    }
    if (course.counting) advance(course, time_s, rolled_m_);
  }
}

void PlantChangeFinder::advance(Course& course, double time_s, double rolled_m) {
  const auto& pieces = course.profile.pieces();
  const bool along_time = course.profile.axis() == FactorProfile::Axis::time;
  const double position = (along_time ? time_s : rolled_m) - course.origin;
  while (course.piece + 1 < pieces.size() && position >= pieces[course.piece + 1].begin) {
    const FactorProfile::Piece& piece = pieces[++course.piece];
    course.changes.push_back({along_time ? course.origin + piece.begin : time_s, label_of(course.what, piece)});
  }
}

std::vector<PlantChange> PlantChangeFinder::changes() const {
  std::vector<PlantChange> all;
  for (const Course& course : courses_) all.insert(all.end(), course.changes.begin(), course.changes.end());
  return all;
}

}  // namespace abs_hil::report
