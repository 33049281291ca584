#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::study {

/// How far the plant strays from what the controller believes. Each magnitude m is a relative half-width: a parameter
/// is drawn uniformly from nominal * [1 - m, 1 + m].
struct Variation {
  double wheels{0.0};  ///< inertias and bearing friction, each wheel's own: J1, J2, d1, d2, M10, M20
  double brake{0.0};   ///< gain of the whole map b(u), its threshold u0 and the lag's c31
  double tyre{0.0};    ///< shape of the tyre curve: B and C, or the slip axis of the maker's curve
  double theta{0.0};   ///< peak tyre force: theta, or with the lever the friction coefficient
  double radii{0.0};   ///< r1 and r2: measured with a caliper, so 0 unless asked for; an error is an error of all slip
  bool phase{false};   ///< where within a count each encoder starts

  /// "parameters=0.1,theta=0.1,phase" (wheels, brake and tyre at 10 %, theta at 10 %, sensor phase).
  [[nodiscard]] static Variation standard() noexcept;
  /// Comma-separated `name=magnitude` and `phase`; `parameters` stands for wheels, brake and tyre; "none" for nothing.
  /// Magnitudes in [0, 0.5]. Throws std::invalid_argument, naming entry and range.
  [[nodiscard]] static Variation parse(std::string_view text);
  /// In the form that `parse` takes.
  [[nodiscard]] std::string text() const;

  friend bool operator==(const Variation&, const Variation&) = default;
};

/// One drawn plant: a factor for each parameter, and the simulator's seed.
struct Perturbation {
  double J1{1.0}, J2{1.0}, d1{1.0}, d2{1.0}, M10{1.0}, M20{1.0};
  double brake_gain{1.0}, u0{1.0}, c31{1.0};
  double B{1.0}, C{1.0};
  double theta{1.0};
  double r1{1.0}, r2{1.0};
  std::uint64_t sensor_seed{1};

  friend bool operator==(const Perturbation&, const Perturbation&) = default;
};

/// Perturbation number `index` of the series `seed`: a function of these two alone, the same on every machine, for
/// every controller and in every thread. What a parameter's number is does not depend on what else is varied.
[[nodiscard]] Perturbation draw(const Variation& variation, std::uint64_t seed, std::uint64_t index);

/// The plant that `perturbation` makes of the nominal one. Values are kept within their valid range (C <= 2, u0 < 1).
[[nodiscard]] plant_sim::PlantOptions perturbed(const plant_sim::PlantOptions& nominal,
                                                const Perturbation& perturbation);

}  // namespace abs_hil::study
