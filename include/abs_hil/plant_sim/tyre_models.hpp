#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

// Friction curves. Each computes the slip by its own definition from the circumferential speeds, the friction
// coefficient relative to its peak ("shape": odd in the slip, at most 1), and bounds on it. All functions are real-time
// safe except for the constructors.
namespace abs_hil::plant_sim {

/// The paper's curve (4): sin(C atan(B slip)), slip (5).
class MagicFormula {
 public:
  explicit MagicFormula(const PlantOptions& options) noexcept
      : tyre_(options.rig.tyre), regularisation_m_s_(options.slip_regularisation_m_s), peak_mu_(options.mu_peak) {}

  [[nodiscard]] double slip(double v_wheel_m_s, double v_x_m_s) const noexcept {
    return rig::wheel_slip(v_wheel_m_s, v_x_m_s, regularisation_m_s_);
  }
  [[nodiscard]] double shape(double slip) const noexcept { return rig::normalised_tyre_force(tyre_, slip); }
  /// Friction coefficient at the peak of the curve.
  [[nodiscard]] double peak_mu() const noexcept { return peak_mu_; }
  /// Upper bound on the slope of `shape` over v_x - v_wheel at these speeds, s/m: its slope B C at slip 0 over the
  /// speed.
  [[nodiscard]] double steepest_s_m(double /*v_wheel_m_s*/, double v_x_m_s) const noexcept {
    return tyre_.B * tyre_.C / std::max(std::abs(v_x_m_s), regularisation_m_s_);
  }

 private:
  rig::TyreParameters tyre_;
  double regularisation_m_s_;
  double peak_mu_;
};

/// The maker's curve (IntecoMuParameters) and slip: (v_x - v_w) / v_x in braking, (v_w - v_x) / v_w in traction, 1 if
/// the wheels turn in opposite directions. With sign s it is (v_x - v_w) over the larger speed, limited to [-1, 1]. It
/// is regularised near standstill like (5).
class IntecoMu {
 public:
  /// Throws std::invalid_argument if the curve is nowhere positive.
  explicit IntecoMu(const PlantOptions& options);

  [[nodiscard]] double slip(double v_wheel_m_s, double v_x_m_s) const noexcept {
    return std::clamp((v_x_m_s - v_wheel_m_s) / larger_speed_m_s(v_wheel_m_s, v_x_m_s), -1.0, 1.0);
  }
  /// The published polynomial is negative (by 2e-6) for slips below 7e-5, where friction would drive; it is clipped to
  /// 0.
  [[nodiscard]] double shape(double slip) const noexcept {
    const double s = std::abs(slip);
    return std::copysign(std::max(0.0, friction_coefficient(s)) / peak_mu_, slip);
  }
  [[nodiscard]] double peak_mu() const noexcept { return peak_mu_; }
  [[nodiscard]] double steepest_s_m(double v_wheel_m_s, double v_x_m_s) const noexcept {
    return steepest_shape_ / larger_speed_m_s(v_wheel_m_s, v_x_m_s);
  }

 private:
  [[nodiscard]] double larger_speed_m_s(double v_wheel_m_s, double v_x_m_s) const noexcept {
    return std::max({std::abs(v_x_m_s), std::abs(v_wheel_m_s), regularisation_m_s_});
  }
  /// mu(s) as published, for s in [0, 1].
  [[nodiscard]] double friction_coefficient(double s) const noexcept {
    const double power = std::pow(s, mu_.p);
    return mu_.w4 * power / (mu_.a + power) + s * (mu_.w1 + s * (mu_.w2 + s * mu_.w3));
  }
  [[nodiscard]] double highest() const noexcept;
  [[nodiscard]] double slope_bound() const noexcept;

  IntecoMuParameters mu_;
  double regularisation_m_s_;
  double peak_mu_{0.0};
  double steepest_shape_{0.0};  ///< upper bound on the slope of `shape` over the slip
};

using TyreModel = std::variant<MagicFormula, IntecoMu>;

/// Makes the model named `options.tyre`. Throws std::invalid_argument with the known names for an unknown one.
[[nodiscard]] TyreModel make_tyre_model(const PlantOptions& options);

}  // namespace abs_hil::plant_sim
