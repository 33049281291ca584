#include "report/plant_changes.hpp"

#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <utility>

namespace abs_hil::report {

namespace {

using plant_sim::FactorProfile;

constexpr std::array<std::pair<const char*, const char*>, 5> profile_keys{{
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
  for (const auto& [key, what] : profile_keys) {
    const auto text = run.config.find(key);
    if (text == run.config.end()) continue;
    try {
      profiles_.push_back({.what = what, .profile = FactorProfile(text->second, key)});
    } catch (const std::invalid_argument&) {
      // The text was written by another version or by hand: show the run without these marks.
    }
  }
}

void PlantChangeFinder::see(double time_s, bool braking, double road_speed_m_s) {
  if (std::exchange(started_, true)) rolled_m_ += 0.5 * (time_s - last_time_s_) * (last_speed_m_s_ + road_speed_m_s);
  last_time_s_ = time_s;
  last_speed_m_s_ = road_speed_m_s;
  for (Profile& profile : profiles_) {
    if (!profile.counting && (braking || !profile.profile.from_braking())) {
      profile.counting = true;
      if (profile.profile.from_braking()) {
        profile.origin = profile.profile.axis() == FactorProfile::Axis::time ? time_s : rolled_m_;
      }
    }
    if (profile.counting) advance(profile, time_s, rolled_m_);
  }
}

void PlantChangeFinder::advance(Profile& profile, double time_s, double rolled_m) {
  const auto& pieces = profile.profile.pieces();
  const bool along_time = profile.profile.axis() == FactorProfile::Axis::time;
  const double position = (along_time ? time_s : rolled_m) - profile.origin;
  while (profile.piece + 1 < pieces.size() && position >= pieces[profile.piece + 1].begin) {
    const FactorProfile::Piece& piece = pieces[++profile.piece];
    profile.changes.push_back({along_time ? profile.origin + piece.begin : time_s, label_of(profile.what, piece)});
  }
}

std::vector<PlantChange> PlantChangeFinder::changes() const {
  std::vector<PlantChange> all;
  for (const Profile& profile : profiles_) all.insert(all.end(), profile.changes.begin(), profile.changes.end());
  return all;
}

}  // namespace abs_hil::report
