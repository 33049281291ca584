#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <variant>

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

// Friction curves. Each computes the slip by its own definition from the circumferential speeds, the friction
// coefficient relative to its peak ("shape": odd in the slip, at most 1), and bounds on it. All functions are real-time
// safe except for the constructors. Friction may fall with the sliding speed: the shape of these speeds has the factor
// 1 - k |v_x - v_wheel|, at least 0, with k of plant.friction_fall_s_m.
namespace abs_hil::plant_sim {

/// A shape with that factor. Lanes skip it where no plant has it; alone the branch costs more than it saves.
template <class S>
[[nodiscard, gnu::always_inline]] inline S fallen(const S& shape, const S& fall_s_m, const S& v_wheel_m_s,
                                                  const S& v_x_m_s) noexcept {
  if constexpr (!std::is_same_v<S, double>) {
    if (!rig::any(fall_s_m > 0.0)) return shape;
  }
  return shape * rig::larger(S(0.0), S(1.0 - fall_s_m * rig::magnitude(S(v_x_m_s - v_wheel_m_s))));
}

/// The paper's curve (4): sin(C atan(B slip)), slip (5). `S` is a `double`, or a pack of them (rig/scalar.hpp).
template <class S>
class BasicMagicFormula {
 public:
  BasicMagicFormula() = default;
  explicit BasicMagicFormula(const PlantOptions& options) noexcept
      : B_(options.rig.tyre.B),
        C_(options.rig.tyre.C),
        regularisation_m_s_(options.slip_regularisation_m_s),
        fall_s_m_(options.friction_fall_s_m),
        peak_mu_(options.mu_peak) {}

  [[nodiscard]] S slip(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    return rig::wheel_slip(v_wheel_m_s, v_x_m_s, regularisation_m_s_);
  }
  [[nodiscard]] S shape(const S& slip) const noexcept { return rig::magic_formula(C_, S(B_ * slip), S(1.0)); }
  /// `shape` of the slip at these speeds, with one division for slip and arctangent.
  [[nodiscard, gnu::always_inline]] S shape_at(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    const S shape = rig::magic_formula(C_, S(B_ * (v_x_m_s - v_wheel_m_s)),
                                       rig::larger(rig::magnitude(v_x_m_s), regularisation_m_s_));
    return fallen(shape, fall_s_m_, v_wheel_m_s, v_x_m_s);
  }
  /// Friction coefficient at the peak of the curve.
  [[nodiscard]] S peak_mu() const noexcept { return peak_mu_; }
  /// Upper bound on the slope of `shape_at` over v_x - v_wheel, s/m: the slope B C at slip 0 over the speed, and that
  /// of the fall.
  [[nodiscard]] S steepest_s_m(const S& /*v_wheel_m_s*/, const S& v_x_m_s) const noexcept {
    return B_ * C_ / rig::larger(rig::magnitude(v_x_m_s), regularisation_m_s_) + fall_s_m_;
  }

 private:
  S B_{0.0};
  S C_{0.0};
  S regularisation_m_s_{0.0};
  S fall_s_m_{0.0};
  S peak_mu_{0.0};
};
using MagicFormula = BasicMagicFormula<double>;

/// The maker's curve (IntecoMuParameters) and slip: (v_x - v_w) / v_x in braking, (v_w - v_x) / v_w in traction, 1 if
/// the wheels turn in opposite directions. With sign s it is (v_x - v_w) over the larger speed, limited to [-1, 1]. It
/// is regularised near standstill like (5).
template <class S>
class BasicIntecoMu {
 public:
  BasicIntecoMu() = default;
  /// Throws std::invalid_argument if the curve is nowhere positive.
  explicit BasicIntecoMu(const PlantOptions& options);

  [[nodiscard]] S slip(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    return rig::clamped(S((v_x_m_s - v_wheel_m_s) / larger_speed_m_s(v_wheel_m_s, v_x_m_s)), S(-1.0), S(1.0));
  }
  /// The published polynomial is negative (by 2e-6) for slips below 7e-5, where friction would drive; it is clipped to
  /// 0.
  [[nodiscard]] S shape(const S& slip) const noexcept {
    const S s = rig::magnitude(slip);
    return rig::with_sign(S(rig::larger(S(0.0), friction_coefficient(s)) / peak_mu_), slip);
  }
  [[nodiscard, gnu::always_inline]] S shape_at(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    return fallen(shape(slip(v_wheel_m_s, v_x_m_s)), fall_s_m_, v_wheel_m_s, v_x_m_s);
  }
  [[nodiscard]] S peak_mu() const noexcept { return peak_mu_; }
  [[nodiscard]] S steepest_s_m(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    return steepest_shape_ / larger_speed_m_s(v_wheel_m_s, v_x_m_s) + fall_s_m_;
  }

 private:
  [[nodiscard]] S larger_speed_m_s(const S& v_wheel_m_s, const S& v_x_m_s) const noexcept {
    return rig::larger(rig::larger(rig::magnitude(v_x_m_s), rig::magnitude(v_wheel_m_s)), regularisation_m_s_);
  }
  /// mu(s) as published, for s in [0, 1].
  [[nodiscard]] S friction_coefficient(const S& s) const noexcept {
    const S power = rig::power(s, p_);
    return w4_ * power / (a_ + power) + s * (w1_ + s * (w2_ + s * w3_));
  }
  [[nodiscard]] double highest() const noexcept;
  [[nodiscard]] double slope_bound() const noexcept;

  S w1_{0.0}, w2_{0.0}, w3_{0.0}, w4_{0.0}, a_{0.0}, p_{0.0};  ///< IntecoMuParameters
  S regularisation_m_s_{0.0};
  S fall_s_m_{0.0};
  S peak_mu_{0.0};
  S steepest_shape_{0.0};  ///< upper bound on the slope of `shape` over the slip
};
using IntecoMu = BasicIntecoMu<double>;

using TyreModel = std::variant<MagicFormula, IntecoMu>;

/// Makes the model named `options.tyre`. Throws std::invalid_argument with the known names for an unknown one.
[[nodiscard]] TyreModel make_tyre_model(const PlantOptions& options);

}  // namespace abs_hil::plant_sim
