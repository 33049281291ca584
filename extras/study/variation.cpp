// Reads what varies, draws factors, and applies them to a plant.
#include "study/variation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "rig/formatted_text.hpp"

namespace abs_hil::study {

namespace {

constexpr double standard_magnitude = 0.1;
constexpr double largest_magnitude = 0.5;
constexpr double largest_C = 2.0;    ///< above this the tyre force would change sign at large slip
constexpr double largest_u0 = 0.99;  ///< the dead zone must leave some duty for braking
/// Seed of the sensors if the phase does not vary.
constexpr std::uint64_t fixed_sensor_seed = 1;

/// A magnitude of its own; the first three are also called parameters.
struct Magnitude {
  std::string_view name;
  double Variation::*value;
};
constexpr std::array<Magnitude, 5> magnitudes{{{"wheels", &Variation::wheels},
                                               {"brake", &Variation::brake},
                                               {"tyre", &Variation::tyre},
                                               {"theta", &Variation::theta},
                                               {"radii", &Variation::radii}}};

double parse_magnitude(std::string_view entry, std::string_view text) {
  const auto value = rig::parse_number<double>(text);
  if (value && *value >= 0.0 && *value <= largest_magnitude) return *value;
  throw std::invalid_argument(
      fmt::format("--vary: \"{}\": give a magnitude in [0, {}], as in theta=0.1", entry, largest_magnitude));
}

void parse_entry(std::string_view entry, Variation& v) {
  if (entry == "phase" || entry == "measured") {
    (entry == "phase" ? v.phase : v.measured) = true;
    return;
  }
  const std::size_t equals = entry.find('=');
  const std::string_view name = entry.substr(0, equals);
  const bool all_parameters = name == "parameters";
  const auto* const named = std::ranges::find(magnitudes, name, &Magnitude::name);
  if (!all_parameters && named == magnitudes.end()) {
    throw std::invalid_argument(fmt::format(
        "--vary: \"{}\" is unknown; give parameters, wheels, brake, tyre, theta, radii, phase, measured or none",
        entry));
  }
  const double magnitude = parse_magnitude(entry, equals == entry.npos ? std::string_view() : entry.substr(equals + 1));
  if (all_parameters) {
    v.wheels = v.brake = v.tyre = magnitude;
  } else {
    v.*named->value = magnitude;
  }
}

/// A factor for each parameter, by the magnitude of its variation; the seed stays.
template <class Factor>
Perturbation perturbation_of(const Variation& v, const Factor& factor) {
  Perturbation p;
  for (double* wheel : {&p.J1, &p.J2, &p.d1, &p.d2, &p.M10, &p.M20}) *wheel = factor(v.wheels);
  for (double* brake : {&p.brake_gain, &p.u0, &p.c31}) *brake = factor(v.brake);
  for (double* tyre : {&p.B, &p.C}) *tyre = factor(v.tyre);
  p.theta = factor(v.theta);
  for (double* radius : {&p.r1, &p.r2}) *radius = factor(v.radii);
  return p;
}

/// A rig as it was measured: the maker's model within the intervals of docs/plants.md, one draw for each number.
void make_measured(plant_sim::PlantOptions& plant, const std::array<double, 15>& draws) {
  auto in = [next = draws.begin()](double from, double to) mutable { return std::lerp(from, to, *next++); };
  const double half_turn_rad = std::numbers::pi;
  plant.tyre = "inteco-mu";
  plant.load = "lever";
  plant.lever = {};
  plant.inteco_mu = {};
  const double friction = in(0.5, 1.05);  // over the printed curve
  for (double* weight : {&plant.inteco_mu.w1, &plant.inteco_mu.w2, &plant.inteco_mu.w3, &plant.inteco_mu.w4})
    *weight *= friction;
  plant.rig.wheels = {.J1_kg_m2 = in(6.0e-3, 7.6e-3), .M20_Nm = in(0.0925, 0.1425)};
  rig::BrakeParameters& brake = plant.rig.brake;
  const double full_Nm = in(16.0, 20.0);
  brake = {.u0 = in(0.455, 0.485), .c31_per_s = in(350.0, 1000.0), .brake_dead_time_s = in(0.011, 0.014)};
  brake.b1_Nm = full_Nm / (1.0 - brake.u0);
  brake.b2_Nm = -brake.b1_Nm * brake.u0;
  brake.brake_release_lead_s = brake.brake_dead_time_s - in(0.008, 0.0105);
  plant.brake_flaws = {.overshoot = in(0.0, 1.0), .ripple_Nm = in(0.0, 2.0)};
  plant.brake_flaws.ripple_phase_rad = in(-half_turn_rad, half_turn_rad);
  plant.rig.motor = {.stall_torque_Nm = 2.70 * in(0.95, 1.05),
                     .no_load_speed_rad_s = 488.0,
                     .start_torque_Nm = 0.970 * in(0.95, 1.05),
                     .start_until_rad_s = 105.0};
  plant.rig.lower_encoder = {.eccentricity_rad = in(0.0, 0.015), .phase_rad = in(-half_turn_rad, half_turn_rad)};
}

/// Uniform in [-1, 1) from the generator's upper 53 bits: the same with every standard library.
double symmetric(std::mt19937_64& generator) { return static_cast<double>(generator() >> 11U) * 0x1p-52 - 1.0; }

}  // namespace

Variation Variation::standard() noexcept {
  return {.wheels = standard_magnitude,
          .brake = standard_magnitude,
          .tyre = standard_magnitude,
          .theta = standard_magnitude,
          .phase = true};
}

Variation Variation::parse(std::string_view text) {
  Variation result;
  if (text == "none") return result;
  for (const std::string_view entry : rig::split(text, ',')) parse_entry(entry, result);
  return result;
}

std::string Variation::text() const {
  std::vector<std::string> entries;
  const auto add = [&entries](std::string_view name, double magnitude) {
    if (magnitude > 0.0) entries.push_back(fmt::format("{}={}", name, magnitude));
  };
  const bool alike = wheels == brake && brake == tyre;
  if (alike) add("parameters", wheels);
  for (const Magnitude& magnitude : std::span(magnitudes).subspan(alike ? 3 : 0)) {
    add(magnitude.name, this->*magnitude.value);
  }
  if (phase) entries.emplace_back("phase");
  if (measured) entries.emplace_back("measured");
  return entries.empty() ? "none" : fmt::format("{}", fmt::join(entries, ","));
}

Perturbation draw(const Variation& v, std::uint64_t seed, std::uint64_t index) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U),
                         static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32U)};
  std::mt19937_64 generator(sequence);
  // Draw all numbers in this order, also the unused ones.
  Perturbation p =
      perturbation_of(v, [&generator](double magnitude) { return 1.0 + magnitude * symmetric(generator); });
  const std::uint64_t sensor_seed = generator();
  p.sensor_seed = v.phase ? sensor_seed : fixed_sensor_seed;
  if (v.measured) {
    for (double& number : p.measured.emplace()) number = 0.5 * (1.0 + symmetric(generator));
  }
  return p;
}

Perturbation smallest(const Variation& v) noexcept {
  Perturbation p = perturbation_of(v, [](double magnitude) { return 1.0 - magnitude; });
  if (v.measured) p.measured.emplace();
  return p;
}

plant_sim::PlantOptions perturbed(const plant_sim::PlantOptions& nominal, const Perturbation& p) {
  plant_sim::PlantOptions plant = nominal;
  if (p.measured) make_measured(plant, *p.measured);
  rig::WheelParameters& w = plant.rig.wheels;
  w.J1_kg_m2 *= p.J1;
  w.J2_kg_m2 *= p.J2;
  w.d1_Nms_rad *= p.d1;
  w.d2_Nms_rad *= p.d2;
  w.M10_Nm *= p.M10;
  w.M20_Nm *= p.M20;
  w.r1_m *= p.r1;
  w.r2_m *= p.r2;
  // Scale b1 and b2 together: better pads scale the whole map.
  rig::BrakeParameters& b = plant.rig.brake;
  b.b1_Nm *= p.brake_gain;
  b.b2_Nm *= p.brake_gain;
  b.u0 = std::min(largest_u0, b.u0 * p.u0);
  b.c31_per_s *= p.c31;
  rig::TyreParameters& t = plant.rig.tyre;
  t.B *= p.B;
  t.C = std::min(largest_C, t.C * p.C);
  // B stretches the slip axis: the maker's curve depends on slip through s^p/a.
  plant_sim::IntecoMuParameters& mu = plant.inteco_mu;
  mu.a /= std::pow(p.B, mu.p);
  if (plant.load == "lever") {
    // Here the force is friction times load, and theta is not a parameter.
    plant.mu_peak *= p.theta;
    for (double* weight : {&mu.w1, &mu.w2, &mu.w3, &mu.w4}) *weight *= p.theta;
  } else {
    t.theta_N *= p.theta;
  }
  return plant;
}

}  // namespace abs_hil::study
