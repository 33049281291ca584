#pragma once

#include <concepts>

#include "abs_hil/rig/parameters.hpp"

/// The paper's laws (13)-(18) in its own symbols and in continuous time, one equation per line. Where the paper has a
/// wrong sign or hat, the line is correct and says so. docs/theory.md gives the reasons and the units. The controllers
/// compute with these lines in sampled-data form (SlipErrorDynamics, ThetaEstimator).
/// tests/control/paper_laws_test.cpp shows that this form converges to these laws as the period goes to 0.
///
/// There is no branch here: freezing, projection and limits belong to the classes that use the laws. Real-time safe.
namespace abs_hil::control::paper {

/// A real number: `double`, or a pack of them that computes lane by lane.
template <class S>
concept Scalar = std::copyable<S> && std::constructible_from<S, double> && requires(S a, S b) {
  { a + b } -> std::convertible_to<S>;
  { a - b } -> std::convertible_to<S>;
  { a* b } -> std::convertible_to<S>;
  { a / b } -> std::convertible_to<S>;
  { -a } -> std::convertible_to<S>;
  { 1.0 - a } -> std::convertible_to<S>;
};

/// Inputs of the laws. Both wheels turn forwards.
template <Scalar S>
struct Reading {
  S omega1{0.0}, omega2{0.0};  ///< wheel speeds, rad/s
  S lambda_ref{0.0};           ///< reference slip, in (0, 1)
  S phi{0.0};                  ///< phi(lambda) of (10): rig::normalised_tyre_force
};

/// Gains of (16)-(18). B'P = [p12 p22] is row 2 of P, because B = [0; 1].
template <Scalar S>
struct Gains {
  S ks0{0.0}, ks1{0.0}, gamma{0.0}, ka1{0.0}, p12{0.0}, p22{0.0};
};

/// P and Q of the Lyapunov equation PA + A'P = -2 Q of Theorem 3.1, both symmetric.
template <Scalar S>
struct Weights {
  S p11{0.0}, p12{0.0}, p22{0.0}, q11{0.0}, q22{0.0};
};

/// State of (17), and its derivative.
template <Scalar S>
struct AdaptiveState {
  S I{0.0}, omega1_hat{0.0}, zeta{0.0};  ///< m, rad/s, N
};

/// The laws for one rig. SI units.
template <Scalar S>
struct Laws {
  // NOLINTBEGIN(modernize-use-nodiscard): one equation a line
  S r1, r2, J1, J2, d1, d2, M10, M20;  ///< Table 1

  // The slip velocity error
  // (13)  e_v = (1 - lambda_ref) v_x - v_w,  v_x = r2 omega2,  v_w = r1 omega1
  constexpr S e_v(const Reading<S>& y) const { return (1.0 - y.lambda_ref) * r2 * y.omega2 - r1 * y.omega1; }
  // (14)  e_v' = (1 - lambda_ref) v_x' - v_w'
  static constexpr S e_v_dot(S lambda_ref, S v_x_dot, S v_w_dot) { return (1.0 - lambda_ref) * v_x_dot - v_w_dot; }
  // (14)  ... = -k theta phi - delta + (r1/J1) Tb, by (11)
  constexpr S e_v_dot(const Reading<S>& y, S theta, S T_b) const {
    return -k(y) * theta * y.phi - delta(y) + r1 / J1 * T_b;
  }
  // (15)  effect of a unit of tyre force on e_v', 1/kg
  constexpr S k(const Reading<S>& y) const { return r1 * r1 / J1 + (1.0 - y.lambda_ref) * r2 * r2 / J2; }
  // (14)  effect of bearing friction on e_v', with the sign in which (16) and (18) cancel it, m/s^2
  constexpr S delta(const Reading<S>& y) const {
    return -r1 / J1 * (d1 * y.omega1 + M10) + (1.0 - y.lambda_ref) * r2 / J2 * (d2 * y.omega2 + M20);
  }

  // Common to both laws: theta is theta0 in (16), theta_hat in (18)
  // (16)  nu = -ks0 I - ks1 e_v, the reference for e_v', m/s^2
  static constexpr S nu(const Gains<S>& g, S I, S e_v) { return -g.ks0 * I - g.ks1 * e_v; }
  // (16)  xi_1 = nu + k theta phi + delta; in (18) the same with theta_hat
  constexpr S xi_1(const Reading<S>& y, S nu, S theta) const { return nu + k(y) * theta * y.phi + delta(y); }
  // (16)  Tb = (J1/r1) xi_1
  constexpr S T_b(S xi_1) const { return J1 / r1 * xi_1; }

  // Nominal law
  // (16)  I' = e_v
  constexpr S nominal_T_b(const Gains<S>& g, const Reading<S>& y, S I, S theta0) const {
    return T_b(xi_1(y, nu(g, I, e_v(y)), theta0));
  }

  // Adaptive law
  // (17)  I' = e_v
  // (17)  omega1_hat' = (r1/J1) theta_hat phi - (d1 omega1 + M10 + Tb)/J1
  //       (the paper prints omega1' on the left: error 5)
  constexpr S omega1_hat_dot(const Reading<S>& y, S theta_hat, S T_b) const {
    return r1 / J1 * theta_hat * y.phi - (d1 * y.omega1 + M10 + T_b) / J1;
  }
  // (17)  B'P [I; e_v], m/s
  static constexpr S BtP_x(const Gains<S>& g, S I, S e_v) { return g.p12 * I + g.p22 * e_v; }
  // (17)  zeta' = -gamma k phi B'P [I; e_v]
  constexpr S zeta_dot(const Gains<S>& g, const Reading<S>& y, S BtP_x) const {
    return -g.gamma * y.phi * (k(y) * BtP_x);
  }
  // (18)  theta_hat = zeta + gamma ka1 (J1/r1) (omega1 - omega1_hat)
  //       (the paper prints a minus before gamma: error 6)
  constexpr S theta_hat(const Gains<S>& g, const AdaptiveState<S>& x, S omega1) const {
    return x.zeta + g.gamma * g.ka1 * (J1 / r1) * (omega1 - x.omega1_hat);
  }
  // (17), (18)  Tb = (J1/r1) xi_1 with theta_hat
  constexpr S adaptive_T_b(const Gains<S>& g, const Reading<S>& y, const AdaptiveState<S>& x) const {
    return T_b(xi_1(y, nu(g, x.I, e_v(y)), theta_hat(g, x, y.omega1)));
  }
  // (17)  all of its derivatives; Tb is the torque that acts
  constexpr AdaptiveState<S> adaptive_dot(const Gains<S>& g, const Reading<S>& y, const AdaptiveState<S>& x,
                                          S T_b) const {
    return {.I = e_v(y),
            .omega1_hat = omega1_hat_dot(y, theta_hat(g, x, y.omega1), T_b),
            .zeta = zeta_dot(g, y, BtP_x(g, x.I, e_v(y)))};
  }

  // Theorem 3.1, with theta_err = theta - theta_hat
  // V = ([I; e_v]' P [I; e_v] + theta_err^2 / gamma) / 2
  static constexpr S V(const Gains<S>& g, const Weights<S>& w, S I, S e_v, S theta_err) {
    return 0.5 * (w.p11 * I * I + 2.0 * w.p12 * I * e_v + w.p22 * e_v * e_v + theta_err * theta_err / g.gamma);
  }
  // V' = -[I; e_v]' Q [I; e_v] - ka1 phi theta_err^2, for a constant theta and phi > 0
  static constexpr S V_dot(const Gains<S>& g, const Weights<S>& w, S I, S e_v, S phi, S theta_err) {
    return -(w.q11 * I * I + w.q22 * e_v * e_v) - g.ka1 * phi * theta_err * theta_err;
  }
  // NOLINTEND(modernize-use-nodiscard)
};

/// The laws for a rig with these parameters.
[[nodiscard]] constexpr Laws<double> laws(const rig::WheelParameters& w) noexcept {
  return {.r1 = w.r1_m,
          .r2 = w.r2_m,
          .J1 = w.J1_kg_m2,
          .J2 = w.J2_kg_m2,
          .d1 = w.d1_Nms_rad,
          .d2 = w.d2_Nms_rad,
          .M10 = w.M10_Nm,
          .M20 = w.M20_Nm};
}

}  // namespace abs_hil::control::paper
