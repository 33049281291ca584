// The prediction-error filter of identification (python/abs_hil/identification): it weighs a log's counts with the
// sensitivities of identification_sensitivities.cpp. It takes one step for each window, whatever the disturbances: with
// the sums that identification_sums.cpp makes once for each linearisation.
//
// In changes from the states and parameters of the linearisation, for window w with the state x (angles, rad, speeds,
// rad/s, brake torque, N m, and five random factors), the parameters' scaled changes p and the readings r, rad:
//
//     r = H x + D p + e,            e ~ N(0, q / weight),  q = (2 pi / counts)^2 / 12
//     x' = F x + G p + gap + v,     v ~ N(0, noise)
//
// Noise drives only the factors: f' = k f + ..., k = exp(-duration / time constant).
//
// With A = H' H / q (weighted) and P = L L' the covariance of x before the readings, a Kalman filter's step is
//
//     M = I + L' A L,   P+ = L M^-1 L',   x+ = x + P+ H' (r - H x - D p) / q,   P' = F P+ F' + noise
//
// x is affine in p, x = x0 + X p, so each innovation is too, and with S the covariance of all readings
//
//     -2 log L(p) = s - 2 n'p + p'N p + log |S|,   N = sum D~' S^-1 D~,   n = sum D~' S^-1 r~
//
// come from one pass, D~ and r~ being the innovations' columns (Gauss-Markov; Kalman 1960; Schweppe 1965). The most
// likely states follow backwards, without an inverse covariance (modified Bryson-Frazier: Bierman 1977).

#include <pybind11/eigen.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "array.hpp"
#include "identification_piece.hpp"

namespace abs_hil::python {

py::dict condense(const py::dict& d);  // identification_sums.cpp

namespace {

struct Filtered {
  Rows normal;             // (parameters, parameters)
  Rows right;              // (parameters, columns)
  Eigen::VectorXd square;  // (columns): sum of squared innovations over their variance
  double log_variance{0.0};
  double readings{0.0};
};

/// What the backward pass needs of a window: the predicted state and its covariance, the updated covariance, what the
/// readings add to the adjoint, and the way to the next window.
struct Passed {
  State predicted;
  Covariance covariance;
  Covariance updated;
  Covariance information;
  State score;
  Covariance transition;
};

/// Lower factor of a covariance that may be singular: a standing wheel and a disturbance of size 0 have none.
Covariance factor_of(const Covariance& P) {
  constexpr double nothing = 1e-13;
  Covariance L = Covariance::Zero();
  for (int j = 0; j < size; ++j) {
    const double rest = P(j, j) - L.row(j).head(j).squaredNorm();
    if (!(rest > nothing * P(j, j))) continue;
    L(j, j) = std::sqrt(rest);
    for (int i = j + 1; i < size; ++i) L(i, j) = (P(i, j) - L.row(i).head(j).dot(L.row(j).head(j))) / L(j, j);
  }
  return L;
}

/// The Kalman filter over one piece. The estimate of the state is affine in the change of the parameters, and so is
/// each innovation: the normal equations of the parameters follow from one pass.
/// @param change  of the parameters, for `passed`; both may be null. With it the states are those at this change, and
///                no normal equations follow
Filtered filter(const Piece& piece, const Disturbed& disturbed, double variance, const Eigen::VectorXd* change,
                std::vector<Passed>* passed) {
  const std::ptrdiff_t p = piece.parameters;
  const std::ptrdiff_t c = piece.sums.columns;
  const std::ptrdiff_t m = states + p;
  constexpr std::ptrdiff_t stacked = 16;
  Filtered out;
  Covariance P = Covariance::Zero();
  const std::ptrdiff_t n = change == nullptr ? c + p : 1;
  Wide X = Wide::Zero(size, n);  // state: the first c columns for each residual, then by parameter
  for (int i = 0; i < states; ++i) P(i, i) = piece.prior_sd.data()[i] * piece.prior_sd.data()[i];
  for (int i = 0; i < disturbances; ++i) P(states + i, states + i) = disturbed.sd[i] * disturbed.sd[i];
  Eigen::Matrix<double, Eigen::Dynamic, size> by_size(m, size);  // products of all with the state's derivatives
  Wide W(size, c + p);  // of the state's derivatives with residuals and (negative) parameters
  Wide D(size, n);      // the same for the columns of the state
  Wide Z(size, n);      // the same at the predicted state
  Wide V(size, n);
  Matrix Q = Matrix::Zero(c + p, c + p);
  // The windows' X, D + Z and V, below each other: their products are large ones, which are faster.
  Matrix Xs(stacked * size, n), Ys(stacked * size, n), Vs(stacked * size, n);
  Covariance F = Covariance::Zero();
  Covariance noise = Covariance::Zero();
  double factors_for_s = -1.0;
  for (std::ptrdiff_t w = 0; w < piece.windows; ++w) {
    const double* stands = piece.stands.data() + w * angles;
    for (int i = 0; i < 2; ++i) {
      if (stands[i] == 0.0) continue;
      P.row(angles + i).setZero();
      P.col(angles + i).setZero();
      X.row(angles + i).setZero();
    }
    const ConstMap gram(piece.sums.gram.data() + w * m * m, m, m);
    const ConstMap cross(piece.sums.cross.data() + w * m * c, m, c);
    const ConstMap square(piece.sums.square.data() + w * c * c, c, c);
    by_size.leftCols(states) = gram.topRows(states).transpose();
    by_size.rightCols(disturbances).setZero();
    for (const auto& [row, state, value] : disturbed.entries) by_size.col(state) += value * gram.row(row).transpose();
    Covariance A;
    A.topRows(states) = by_size.topRows(states);
    A.bottomRows(disturbances).setZero();
    W.topLeftCorner(states, c) = cross.topRows(states);
    W.bottomLeftCorner(disturbances, c).setZero();
    for (const auto& [row, state, value] : disturbed.entries) {
      A.row(state) += value * by_size.row(row);
      W.row(state).head(c) += value * cross.row(row);
    }
    W.rightCols(p) = -by_size.bottomRows(p).transpose();
    A /= variance;
    W /= variance;
    if (change == nullptr) {
      D = W;
    } else {
      D = W.col(0) + W.rightCols(p) * *change;
    }
    Z.noalias() = D - A.lazyProduct(X);
    // The readings' covariance is variance / weight and that of the state: the latter leaves V' V less.
    const Covariance L = factor_of(P);
    const Covariance AL = A.lazyProduct(L);
    Covariance root = L.transpose();
    const Eigen::LLT<Covariance> inner(Covariance::Identity() + root.lazyProduct(AL));
    inner.matrixL().solveInPlace(root);
    V.noalias() = root.lazyProduct(Z);
    if (change == nullptr) {
      Q.topLeftCorner(c, c) += square / variance;
      Q.bottomLeftCorner(p, c) -= cross.bottomRows(p) / variance;
      Q.bottomRightCorner(p, p) += gram.bottomRightCorner(p, p) / variance;
      const std::ptrdiff_t place = w % stacked * size;
      Xs.middleRows<size>(place) = X;
      Ys.middleRows<size>(place) = D + Z;
      Vs.middleRows<size>(place) = V;
      if (const std::ptrdiff_t filled = place + size; filled == Xs.rows() || w + 1 == piece.windows) {
        Q.triangularView<Eigen::Lower>() -= 0.5 * Xs.topRows(filled).transpose() * Ys.topRows(filled);
        Q.triangularView<Eigen::Lower>() -= 0.5 * Ys.topRows(filled).transpose() * Xs.topRows(filled);
        Q.triangularView<Eigen::Lower>() -= Vs.topRows(filled).transpose() * Vs.topRows(filled);
      }
    }
    out.log_variance += piece.sums.readings.data()[angles * w] * std::log(variance) - piece.sums.log_weight.data()[w] +
                        2.0 * inner.matrixLLT().diagonal().array().log().sum();
    out.readings += piece.sums.readings.data()[angles * w + 1];
    const Covariance back = root.transpose();
    const Covariance updated = back.lazyProduct(root);
    if (passed != nullptr) passed->push_back({X.col(0), P, updated, A, Z.col(0), {}});
    X.noalias() += back.lazyProduct(V);

    const double duration_s =
        piece.time_s.data()[piece.first.data()[w + 1]] - piece.time_s.data()[piece.first.data()[w]];
    F.topLeftCorner<states, states>().setZero();
    F(0, 0) = F(1, 1) = 1.0;
    F.block<states, moving>(0, angles) = ConstMap(piece.end_by_state.data() + w * states * moving, states, moving);
    const ConstMap G(piece.end_by_parameter.data() + w * states * p, states, p);
    F.topRightCorner<states, disturbances>() = G * disturbed.into;
    if (duration_s != factors_for_s) {
      factors_for_s = duration_s;
      for (int i = 0; i < disturbances; ++i) {
        const double keeps = std::exp(-duration_s / disturbed.time_constant_s[i]);
        F(states + i, states + i) = keeps;
        noise(states + i, states + i) = (1.0 - keeps * keeps) * disturbed.sd[i] * disturbed.sd[i];
      }
    }
    V.noalias() = F.lazyProduct(X);
    X.swap(V);
    X.topLeftCorner(states, c) += ConstMap(piece.gap.data() + w * states * c, states, c);
    if (change == nullptr) {
      X.topRightCorner(states, p) += G;
    } else {
      X.topRows(states) += G * *change;
    }
    const Covariance moved = F.lazyProduct(updated), turned = F.transpose();
    P = moved.lazyProduct(turned) + noise;
    P = 0.5 * (P + P.transpose()).eval();
    if (passed != nullptr) passed->back().transition = F;
  }
  out.normal = Q.bottomRightCorner(p, p).selfadjointView<Eigen::Lower>();
  out.right = -Q.bottomLeftCorner(p, c);
  out.square = Q.topLeftCorner(c, c).diagonal();
  return out;
}

py::tuple filter_pieces(const py::list& pieces, const Array& directions, const Array& sd, const Array& time_constant_s,
                        double variance) {
  const Disturbed disturbed(directions, sd, time_constant_s);
  py::list all;
  for (const py::handle item : pieces) {
    const Piece piece(item.cast<py::dict>());
    Filtered one;
    {
      const py::gil_scoped_release release;
      one = filter(piece, disturbed, variance, nullptr, nullptr);
    }
    all.append(py::make_tuple(one.normal, one.right, one.square, one.log_variance, one.readings));
  }
  return py::tuple(all);
}

/// The most likely changes of state at the windows' starts for a change of the parameters, shape (windows, 10): the
/// five of the plant and the disturbances; and the weighted sum of squares of what they leave of the residuals. The
/// backward pass (modified Bryson-Frazier) inverts no covariance: a standing wheel's is singular.
py::tuple smooth(const py::dict& d, const Array& by_parameters, const Array& directions, const Array& sd,
                 const Array& time_constant_s, double variance) {
  const Piece piece(d);
  const std::ptrdiff_t p = piece.parameters;
  const Disturbed disturbed(directions, sd, time_constant_s);
  if (by_parameters.size() != p || piece.sums.columns != 1)
    throw std::invalid_argument("give one change of each parameter");
  auto changes = new_array<Array>({piece.windows, static_cast<std::ptrdiff_t>(size)});
  double* const to = changes.mutable_data();
  double left = 0.0;
  {
    const py::gil_scoped_release release;
    const Eigen::VectorXd change = Eigen::Map<const Eigen::VectorXd>(by_parameters.data(), p);
    std::vector<Passed> passed;
    passed.reserve(static_cast<std::size_t>(piece.windows));
    filter(piece, disturbed, variance, &change, &passed);
    State adjoint = State::Zero();  // behind the window
    Eigen::VectorXd all(states + p);
    for (std::ptrdiff_t w = piece.windows - 1; w >= 0; --w) {
      const Passed& at = passed[static_cast<std::size_t>(w)];
      adjoint = (at.transition.transpose() * adjoint).eval() + at.score;
      const State best = at.predicted + at.updated * adjoint;
      std::copy_n(best.data(), size, to + w * size);
      adjoint = (Covariance::Identity() + at.information * at.covariance).partialPivLu().solve(adjoint).eval();
      for (int i = 0; i < 2; ++i) {
        if (piece.stands.data()[w * angles + i] != 0.0) adjoint(angles + i) = 0.0;
      }
      all.head(states) = best.head(states);
      all.tail(p) = change + disturbed.into * best.tail(disturbances);
      const std::ptrdiff_t m = states + p;
      const ConstMap gram(piece.sums.gram.data() + w * m * m, m, m);
      const Eigen::Map<const Eigen::VectorXd> cross(piece.sums.cross.data() + w * m, m);
      left += piece.sums.square.data()[w] + all.dot(gram * all - 2.0 * cross);
    }
  }
  return py::make_tuple(changes, left);
}

/// Slopes of -2 log likelihood at a change of the parameters: by the logarithms of the disturbances' standard
/// deviations and of their time constants, shape (2, 5). M is the slope by a predicted covariance; backwards as in
/// `smooth`.
Array slopes(const py::dict& d, const Array& by_parameters, const Array& directions, const Array& sd,
             const Array& time_constant_s, double variance) {
  const Piece piece(d);
  const Disturbed disturbed(directions, sd, time_constant_s);
  if (by_parameters.size() != piece.parameters || piece.sums.columns != 1)
    throw std::invalid_argument("give one change of each parameter");
  auto all = new_array<Array>({2, disturbances});
  double* const by_sd = all.mutable_data();
  double* const by_time = by_sd + disturbances;
  const py::gil_scoped_release release;
  const Eigen::VectorXd change = Eigen::Map<const Eigen::VectorXd>(by_parameters.data(), piece.parameters);
  std::vector<Passed> passed;
  passed.reserve(static_cast<std::size_t>(piece.windows));
  filter(piece, disturbed, variance, &change, &passed);
  std::fill_n(by_sd, 2 * disturbances, 0.0);
  State adjoint = State::Zero();
  Covariance information = Covariance::Zero();
  Covariance M = Covariance::Zero();
  for (std::ptrdiff_t w = piece.windows - 1; w >= 0; --w) {
    const Passed& at = passed[static_cast<std::size_t>(w)];
    const Covariance back = at.transition.transpose();
    const Covariance through = back.lazyProduct(M), by_transition = at.updated.lazyProduct(through);
    const State updated = at.predicted + at.updated * at.score;
    for (int i = 0; i < disturbances; ++i) {
      const int state = states + i;
      const double keeps = at.transition(state, state);
      const double by_noise = M(state, state) * disturbed.sd[i] * disturbed.sd[i];
      by_sd[i] += 2.0 * (1.0 - keeps * keeps) * by_noise;
      by_time[i] -= 2.0 * keeps * std::log(keeps) *
                    (by_transition(state, state) - updated(state) * adjoint(state) - keeps * by_noise);
    }
    const Covariance passing = Covariance::Identity() - at.information.lazyProduct(at.updated);
    const Covariance passing_back = passing.transpose();
    const Covariance behind = back.lazyProduct(information), moved = behind.lazyProduct(at.transition);
    const Covariance taken = passing.lazyProduct(moved);
    adjoint = (passing * (back * adjoint + at.score)).eval();
    information = taken.lazyProduct(passing_back) + passing.lazyProduct(at.information);
    for (int i = 0; i < 2; ++i) {
      if (piece.stands.data()[w * angles + i] == 0.0) continue;
      adjoint(angles + i) = 0.0;
      information.row(angles + i).setZero();
      information.col(angles + i).setZero();
    }
    M = information - adjoint * adjoint.transpose();
  }
  for (int i = 0; i < disturbances; ++i)
    by_sd[i] += 2.0 * M(states + i, states + i) * disturbed.sd[i] * disturbed.sd[i];
  return all;
}

}  // namespace

void add_identification_filter(py::module_& module) {
  module.def("condense", &condense, py::arg("piece"));
  module.def("filter_pieces", &filter_pieces, py::arg("pieces"), py::arg("directions"), py::arg("sd"),
             py::arg("time_constant_s"), py::arg("variance"));
  module.def("slopes", &slopes, py::arg("piece"), py::arg("change"), py::arg("directions"), py::arg("sd"),
             py::arg("time_constant_s"), py::arg("variance"));
  module.def("smooth", &smooth, py::arg("piece"), py::arg("change"), py::arg("directions"), py::arg("sd"),
             py::arg("time_constant_s"), py::arg("variance"));
}

}  // namespace abs_hil::python
