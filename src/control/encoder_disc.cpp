// Corrects and fits the eccentricity of an encoder's disc.
#include "control/encoder_disc.hpp"

#include <cmath>
#include <numbers>

#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::control {
namespace {

/// Fewer turns in a block do not part the eccentricity from the cubic.
constexpr double least_turns = 3.0;
/// Root mean square of what a fit may leave, counts. Counting leaves 0.29, unequal slots and a dirty place more.
constexpr double most_left_counts = 1.0;
constexpr double least_eccentricity_counts = 0.25;

[[nodiscard]] std::int32_t within_turn(std::int64_t counts, std::int32_t counts_per_rev) noexcept {
  const auto rest = static_cast<std::int32_t>(counts % counts_per_rev);
  return rest < 0 ? rest + counts_per_rev : rest;
}

/// Angle of the middle of a count.
[[nodiscard]] double middle_rad(std::int32_t place, double rad_per_count) noexcept {
  return (static_cast<double>(place) + 0.5) * rad_per_count;
}

[[nodiscard]] double sine_of(double angle_rad) noexcept {
  return rig::sine(std::remainder(angle_rad, 2.0 * std::numbers::pi));
}
[[nodiscard]] double cosine_of(double angle_rad) noexcept {
  return rig::cosine(std::remainder(angle_rad, 2.0 * std::numbers::pi));
}

}  // namespace

double EncoderDisc::corrected(std::int32_t travel) noexcept {
  const double before = error_counts_;
  error_counts_ = error_counts();
  return travel - (error_counts_ - before);
}

void EncoderDisc::know(const rig::EccentricityParameters& eccentricity) noexcept {
  eccentricity_ = eccentricity;
  error_counts_ = eccentric() ? error_counts() : 0.0;
}

/// The reading r is psi + e sin(psi), psi the disc's angle. Two steps of psi = r - e sin(psi) leave e^3.
double EncoderDisc::error_counts() const noexcept {
  const double rad_per_count = rig::radians_per_count(counts_per_rev_);
  const double e = eccentricity_.eccentricity_rad;
  const double read_rad = middle_rad(within_turn(turned_, counts_per_rev_), rad_per_count) + eccentricity_.phase_rad;
  const double first_rad = e * sine_of(read_rad);
  return e * sine_of(read_rad - e * sine_of(read_rad - first_rad)) / rad_per_count;
}

EccentricityFit::EccentricityFit(double block_s, std::int32_t counts_per_rev) noexcept
    : block_s_{block_s}, counts_per_rev_{counts_per_rev} {}

void EccentricityFit::begin(std::int64_t time_ns, std::int32_t counts) noexcept {
  start_ns_ = time_ns;
  start_counts_ = latest_counts_ = counts;
  travel_ = 0;
  squares_rad2_ = 0.0;
  normal_ = {};
}

auto EccentricityFit::take(std::int64_t time_ns, std::int32_t counts) noexcept
    -> std::optional<rig::EccentricityParameters> {
  if (samples_ == 0) begin(time_ns, counts);
  travel_ += rig::counts_between(latest_counts_, counts);
  latest_counts_ = counts;
  const double rad_per_count = rig::radians_per_count(counts_per_rev_);
  const double passed_s = static_cast<double>(time_ns - start_ns_) * rig::s_per_ns;
  const double t = 2.0 * passed_s / block_s_ - 1.0;  // in [-1, 1], where the powers are far from each other
  const double read_rad =
      middle_rad(within_turn(static_cast<std::int64_t>(start_counts_) + travel_, counts_per_rev_), rad_per_count);
  constexpr std::size_t columns = unknowns + 1;
  const std::array<double, columns> row{
      1.0, t, t * t, t * t * t, cosine_of(read_rad), sine_of(read_rad), static_cast<double>(travel_) * rad_per_count};
  for (std::size_t i = 0; i < unknowns; ++i) {
    for (std::size_t j = i; j < columns; ++j) normal_[i][j] += row[i] * row[j];
  }
  squares_rad2_ += row[unknowns] * row[unknowns];
  ++samples_;
  if (passed_s < block_s_) return std::nullopt;
  const bool often_enough = std::abs(static_cast<double>(travel_)) >= least_turns * counts_per_rev_;
  const auto result = often_enough ? solved() : std::nullopt;
  restart();
  return result;
}

/// Elimination of the symmetric positive definite equations, which needs no pivots. Only A and B are wanted, the last
/// two.
auto EccentricityFit::solved() noexcept -> std::optional<rig::EccentricityParameters> {
  constexpr double least_pivot = 1e-9;  // of the largest that it can be
  for (std::size_t k = 0; k < unknowns; ++k) {
    if (!(normal_[k][k] > least_pivot * static_cast<double>(samples_))) return std::nullopt;
    for (std::size_t i = k + 1; i < unknowns; ++i) {
      const double part = normal_[k][i] / normal_[k][k];
      for (std::size_t j = i; j <= unknowns; ++j) normal_[i][j] -= part * normal_[k][j];
    }
  }
  const double rad_per_count = rig::radians_per_count(counts_per_rev_);
  double left_rad2 = squares_rad2_;
  for (std::size_t k = 0; k < unknowns; ++k) left_rad2 -= normal_[k][unknowns] * normal_[k][unknowns] / normal_[k][k];
  const double most_left_rad = most_left_counts * rad_per_count;
  if (!(left_rad2 <= most_left_rad * most_left_rad * static_cast<double>(samples_))) return std::nullopt;
  const double sine = normal_[5][6] / normal_[5][5];
  const double cosine = (normal_[4][6] - normal_[4][5] * sine) / normal_[4][4];
  // A cos + B sin = e sin(angle + phase).
  if (std::hypot(cosine, sine) < least_eccentricity_counts * rad_per_count) return rig::EccentricityParameters{};
  return rig::EccentricityParameters{.eccentricity_rad = std::hypot(cosine, sine),
                                     .phase_rad = std::atan2(cosine, sine)};
}

}  // namespace abs_hil::control
