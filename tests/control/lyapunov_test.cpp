// The Lyapunov equation, solved for random gains and for Table 1's by hand.
#include <Eigen/LU>
#include <limits>
#include <random>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "catch.hpp"
#include "control/adaptive_gains.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

Eigen::Matrix2d matrix(double a, double b, double c, double d) {
  Eigen::Matrix2d M;
  M << a, b, c, d;
  return M;
}

}  // namespace

TEST_CASE("The Lyapunov equation is solved for random Q and gains") {
  std::mt19937 random{7};
  std::uniform_real_distribution<double> entry{-3.0, 3.0}, gain{0.5, 80.0};
  for (int i = 0; i < 200; ++i) {
    const Eigen::Matrix2d root = matrix(entry(random), entry(random), entry(random), entry(random));
    const Eigen::Matrix2d Q = root * root.transpose() + 0.1 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d A = matrix(0.0, 1.0, -gain(random), -gain(random));
    const Eigen::Matrix2d P = control::solve_lyapunov(A, Q);
    const Eigen::Matrix2d residual = P * A + A.transpose() * P + 2.0 * Q;
    CHECK_THAT(residual.norm(), WithinAbs(0.0, 1e-9 * (1.0 + P.norm() * A.norm())));
    CHECK(P.isApprox(P.transpose()));
    CHECK(P.determinant() > 0.0);
    CHECK(P.trace() > 0.0);
  }
}

TEST_CASE("P for Table 1's gains is the one worked out by hand") {
  const double ks0 = 19.0, ks1 = 32.0, q11 = 2.0, q12 = 0.3, q22 = 1.5;
  const Eigen::Matrix2d P =
      control::solve_lyapunov(control::error_dynamics_matrix(ks0, ks1), matrix(q11, q12, q12, q22));
  const double p12 = q11 / ks0;
  const double p22 = (q22 + p12) / ks1;
  const double p11 = ks1 * p12 + ks0 * p22 - 2.0 * q12;
  CHECK_THAT(P(0, 1), WithinRel(p12, 1e-12));
  CHECK_THAT(P(1, 1), WithinRel(p22, 1e-12));
  CHECK_THAT(P(0, 0), WithinRel(p11, 1e-12));
}

TEST_CASE("A general stable A is solved too, not only the companion form") {
  const Eigen::Matrix2d A = matrix(-1.0, 5.0, -2.0, -0.5), Q = matrix(1.0, 0.2, 0.2, 3.0);
  const Eigen::Matrix2d P = control::solve_lyapunov(A, Q);
  CHECK_THAT((P * A + A.transpose() * P + 2.0 * Q).norm(), WithinAbs(0.0, 1e-12));
}

TEST_CASE("Q that is not symmetric and positive definite, and an unstable A, are refused") {
  const Eigen::Matrix2d A = control::error_dynamics_matrix(19.0, 32.0);
  CHECK_THROWS_AS(control::solve_lyapunov(A, matrix(1.0, 2.0, 2.0, 1.0)), std::invalid_argument);
  CHECK_THROWS_AS(control::solve_lyapunov(A, matrix(1.0, 0.5, 0.0, 1.0)), std::invalid_argument);
  CHECK_THROWS_AS(control::solve_lyapunov(A, matrix(0.0, 0.0, 0.0, 1.0)), std::invalid_argument);
  CHECK_THROWS_AS(control::solve_lyapunov(A, matrix(1.0, 0.0, 0.0, std::numeric_limits<double>::quiet_NaN())),
                  std::invalid_argument);
  CHECK_THROWS_AS(control::solve_lyapunov(control::error_dynamics_matrix(-19.0, 32.0), matrix(1.0, 0.0, 0.0, 1.0)),
                  std::invalid_argument);
}
