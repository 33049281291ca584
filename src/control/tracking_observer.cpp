// Decides which readings of an encoder count, and predicts the speed while they do not.
#include "control/tracking_observer.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::control {

namespace {
constexpr int ignored_max = 2;  ///< then the readings are right and the estimate is wrong
constexpr double resolution_counts = 2.0;
}  // namespace

TrackingObserver::TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev, double alpha_max_rad_s2,
                                   const rig::EccentricityParameters& eccentricity) noexcept
    : tracker_{options, counts_per_rev}, disc_{eccentricity, counts_per_rev}, alpha_max_rad_s2_{alpha_max_rad_s2} {}

void TrackingObserver::reset(std::int32_t counts, double omega_rad_s) noexcept {
  disc_.reset(counts);
  travel_ = ignored_travel_ = direction_ = place_ = 0.0;
  tracker_.reset(omega_rad_s);
  omega_rad_s_ = omega_rad_s;
  ignored_ = 0;
  ignored_s_ = 0.0;
}

[[gnu::noinline]] bool TrackingObserver::implausible(double travel, double stamp_error_s) const noexcept {
  const double resolution_rad = resolution_counts * tracker_.rad_per_count();
  const bool uncertain = std::abs(omega_rad_s_) * stamp_error_s > resolution_rad;
  const double correction_rad_s = tracker_.omega_gain() * tracker_.residual_rad(travel);
  const double unexplained_rad_s = std::abs(correction_rad_s) - tracker_.omega_gain() * resolution_rad;
  return uncertain && ignored_ < ignored_max && unexplained_rad_s > alpha_max_rad_s2_ * tracker_.dt_s();
}

double TrackingObserver::place_in_count(double edge_age_s) const noexcept {
  if (!(edge_age_s >= 0.0)) return 0.0;
  const double turned = tracker_.predicted_rad_s() * edge_age_s / tracker_.rad_per_count();
  return std::clamp(turned - 0.5 * direction_, -0.5, 0.5);
}

void TrackingObserver::update(std::int32_t counts, double dt_s, double stamp_error_s, double edge_age_s) noexcept {
  if (!(dt_s > 0.0)) return;  // the next interval then includes this travel
  travel_ = disc_.take(counts);
  if (travel_ != 0.0) direction_ = std::copysign(1.0, travel_);
  const double whole = travel_ + ignored_travel_;
  tracker_.note(whole, dt_s);
  if (tracker_.stands_still()) {
    tracker_.stop_where(true);
  } else {
    // After an ignored reading the next one counts for the whole time since the last that was taken: its travel does
    // too, and gains for a shorter time would make the filter unstable.
    const double since_taken_s = ignored_s_ + dt_s;
    if (since_taken_s != tracker_.dt_s()) tracker_.prepare(since_taken_s);
    const double place = place_in_count(edge_age_s);
    const double travel = whole + place - place_;
    if (stamp_error_s > 0.0 && implausible(travel, stamp_error_s)) {
      omega_rad_s_ = tracker_.predicted_rad_s();
      tracker_.bound_by_silence(whole, omega_rad_s_);
      ++ignored_;
      ignored_s_ = since_taken_s;
      ignored_travel_ = whole;
      return;
    }
    if (tracker_.must_restart()) [[unlikely]] {
      tracker_.restart(travel);
    } else {
      tracker_.correct(travel);
    }
    tracker_.bound_by_silence(whole);
    place_ = place;
  }
  omega_rad_s_ = tracker_.omega_rad_s();
  ignored_ = 0;
  ignored_s_ = ignored_travel_ = 0.0;
}

}  // namespace abs_hil::control
