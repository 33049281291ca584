// What the tyre and load models compute from their options when they are made.
#include <numbers>
#include <stdexcept>
#include <string>

#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"

namespace abs_hil::plant_sim {
namespace {

/// Friction must leave at least this share of the lever's arm L sin phi; below it the normal force would increase more
/// than tenfold.
constexpr double least_arm = 0.1;

constexpr double square(double x) noexcept { return x * x; }

}  // namespace

template <class S>
BasicIntecoMu<S>::BasicIntecoMu(const PlantOptions& options)
    : w1_(options.inteco_mu.w1),
      w2_(options.inteco_mu.w2),
      w3_(options.inteco_mu.w3),
      w4_(options.inteco_mu.w4),
      a_(options.inteco_mu.a),
      p_(options.inteco_mu.p),
      regularisation_m_s_(options.slip_regularisation_m_s),
      fall_s_m_(options.friction_fall_s_m),
      peak_mu_(highest()) {
  if (!(peak_mu_ > 0.0)) {
    throw std::invalid_argument(
        "plant.mu_w4 = " + std::to_string(w4_) +
        ": the friction curve of plant.mu_w1 ... mu_p is nowhere positive; raise plant.mu_w4 (published: 0.40663)");
  }
  steepest_shape_ = slope_bound() / peak_mu_;
}

/// The maximum of the curve on [0, 1]. It may lie at an end: the published curve is highest at 1.
template <class S>
double BasicIntecoMu<S>::highest() const noexcept {
  // Sample more densely at small slips, where the knee is; then run a golden-section search around the best sample.
  constexpr int samples = 200;
  const auto sample = [](int i) { return square(static_cast<double>(i) / samples); };
  int best = 0;
  for (int i = 1; i <= samples; ++i) {
    if (friction_coefficient(sample(i)) > friction_coefficient(sample(best))) best = i;
  }
  double left = sample(std::max(best - 1, 0));
  double right = sample(std::min(best + 1, samples));
  constexpr double golden = 0.6180339887498949;
  for (int i = 0; i < 40; ++i) {
    const double a = right - golden * (right - left);
    const double b = left + golden * (right - left);
    (friction_coefficient(a) < friction_coefficient(b) ? left : right) =
        friction_coefficient(a) < friction_coefficient(b) ? a : b;
  }
  return std::max(friction_coefficient(0.5 * (left + right)), friction_coefficient(sample(best)));
}

/// Upper bound on |mu'| over [0, 1]. The saturating term is steepest at its turning point, s^p = a (p - 1) / (p + 1);
/// the polynomial's slope is bounded term by term.
template <class S>
double BasicIntecoMu<S>::slope_bound() const noexcept {
  const double power = a_ * (p_ - 1.0) / (p_ + 1.0);
  const double s = std::pow(power, 1.0 / p_);
  const double saturating = std::abs(w4_) * a_ * p_ * std::pow(s, p_ - 1.0) / square(a_ + power);
  return saturating + std::abs(w1_) + 2.0 * std::abs(w2_) + 3.0 * std::abs(w3_);
}

template class BasicIntecoMu<double>;

TyreModel make_tyre_model(const PlantOptions& options) {
  if (options.tyre == "magic-formula") return MagicFormula(options);
  if (options.tyre == "inteco-mu") return IntecoMu(options);
  throw std::invalid_argument("plant.tyre = \"" + options.tyre + "\": give magic-formula or inteco-mu");
}

template <class S>
BasicLeverLoad<S>::BasicLeverLoad(const PlantOptions& options, double peak_mu, double friction_at_most)
    : peak_mu_(peak_mu),
      r1_m_(options.rig.wheels.r1_m),
      Mg_Nm_(options.lever.Mg_Nm),
      L_sin_phi_m_(options.lever.L_m * std::sin(options.lever.phi_deg * std::numbers::pi / 180.0)),
      L_cos_phi_m_(options.lever.L_m * std::cos(options.lever.phi_deg * std::numbers::pi / 180.0)) {
  const double most_mu = (1.0 - least_arm) * L_sin_phi_m_ / wedging_m(UpperWheelTorques<S, double>{});
  if (peak_mu * friction_at_most <= most_mu) return;
  throw std::invalid_argument("plant.load = \"lever\": a friction coefficient of " +
                              std::to_string(peak_mu * friction_at_most) +
                              " would wedge the wheel under its lever; it can be at most " + std::to_string(most_mu) +
                              " with this plant.lever_L_m, plant.lever_phi_deg and plant.r1_m");
}

template class BasicLeverLoad<double>;

LoadModel make_load_model(const PlantOptions& options, double peak_mu, double friction_at_most) {
  if (options.load == "constant") return ConstantLoad(options);
  if (options.load == "lever") return LeverLoad(options, peak_mu, friction_at_most);
  throw std::invalid_argument("plant.load = \"" + options.load + "\": give constant or lever");
}

}  // namespace abs_hil::plant_sim
