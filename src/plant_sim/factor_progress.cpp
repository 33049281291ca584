#include "abs_hil/plant_sim/factor_progress.hpp"

#include <algorithm>

namespace abs_hil::plant_sim {
namespace {

/// Rounding error of the sum of a run's intervals; a piece with less time left has ended.
constexpr double time_rounding_s = 1e-11;

}  // namespace

void FactorProgress::start(double angle2_rad) noexcept {
  index_ = 0;
  time_s_ = 0.0;
  origin_time_s_ = 0.0;
  origin_angle2_rad_ = angle2_rad;
  counting_ = !profile_.from_braking();
}

void FactorProgress::brake_applied(double angle2_rad) noexcept {
  if (counting_) return;
  counting_ = true;
  origin_time_s_ = time_s_;
  origin_angle2_rad_ = angle2_rad;
}

void FactorProgress::settle_on_changes(double angle2_rad) noexcept {
  if (!counting_) return;
  // The last piece ends at infinity. Along the distance this is the same comparison as in the integration.
  while (along_time() ? time_left_s() <= time_rounding_s : angle2_rad >= end_angle2_rad()) ++index_;
}

PresentFactor FactorProgress::present_of_changes(double angle2_rad) const noexcept {
  const FactorProfile::Piece& p = piece();
  PresentFactor now{.value = p.value, .angle2_rad = angle2_rad, .highest = p.highest()};
  if (!counting_) return now;
  if (p.slope != 0.0) {
    const double position = along_time() ? time_s_ - origin_time_s_ : r2_m_ * (angle2_rad - origin_angle2_rad_);
    now.value = p.at(std::clamp(position, p.begin, p.end));
    (along_time() ? now.per_s : now.per_rad) = along_time() ? p.slope : p.slope * r2_m_;
  }
  if (!along_time()) now.end_angle2_rad = end_angle2_rad();
  return now;
}

}  // namespace abs_hil::plant_sim
