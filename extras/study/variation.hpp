// Plants that vary around a nominal one, drawn from a seed and a number.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::study {

/// Variation of the plant around the controller's nominal parameters. Each magnitude m is a relative half-width: a
/// parameter is uniform in nominal * [1 - m, 1 + m].
struct Variation {
  double wheels{0.0};  ///< inertia and bearing friction of each wheel: J1, J2, d1, d2, M10, M20
  double brake{0.0};   ///< gain of the map b(u), its threshold u0, and c31 of the lag
  double tyre{0.0};    ///< shape of the tyre curve: B and C, or the slip axis of the maker's curve
  double theta{0.0};   ///< peak tyre force: theta, or the friction coefficient with the lever
  double radii{0.0};   ///< r1 and r2, 0 by default, as a caliper measures them; an error affects every slip value
  bool phase{false};   ///< initial position of each encoder within a count
  bool measured{
      false};  ///< in place of the nominal plant a rig as it was measured (docs/plants.md); the rest scales it

  /// "parameters=0.1,theta=0.1,phase" (wheels, brake and tyre at 10 %, theta at 10 %, sensor phase).
  [[nodiscard]] static Variation standard() noexcept;
  /// Comma-separated `name=magnitude`, `phase` and `measured`. `parameters` stands for wheels, brake and tyre; "none"
  /// for no variation. Magnitudes in [0, 0.5]. Throws std::invalid_argument, naming entry and range.
  [[nodiscard]] static Variation parse(std::string_view text);
  /// The text form that `parse` accepts.
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
  std::optional<std::array<double, 15>> measured{};  ///< numbers in [0, 1): where in their ranges its values lie

  friend bool operator==(const Perturbation&, const Perturbation&) = default;
};

/// Perturbation number `index` of the given `seed`. It depends on these two alone: it is the same on every computer,
/// for every controller and in every thread. The value of one parameter does not depend on which others vary.
[[nodiscard]] Perturbation draw(const Variation& variation, std::uint64_t seed, std::uint64_t index);

/// The perturbation with every factor at its lower end.
[[nodiscard]] Perturbation smallest(const Variation& variation) noexcept;

/// Applies a perturbation to the nominal plant. Values stay within their valid range (C <= 2, u0 < 1).
[[nodiscard]] plant_sim::PlantOptions perturbed(const plant_sim::PlantOptions& nominal,
                                                const Perturbation& perturbation);

}  // namespace abs_hil::study
