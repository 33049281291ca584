// The prediction-error filter of identification (python/abs_hil/identification): it weighs a log's counts with the
// sensitivities of identification.cpp.

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "bindings.hpp"

namespace abs_hil::python {

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

constexpr std::ptrdiff_t states = 5;  // angle1, angle2, omega1, omega2, brake torque
constexpr std::ptrdiff_t angles = 2;
constexpr std::ptrdiff_t moving = states - angles;  // those that the motion depends on: the angles only add up

constexpr int disturbances = 5;
constexpr int size = states + disturbances;
using State = Eigen::Matrix<double, size, 1>;
using Covariance = Eigen::Matrix<double, size, size>;
using Row = Eigen::Matrix<double, 1, size>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMap = Eigen::Map<const Rows>;

/// A linearised piece of a log (`linearise`), with what was measured.
struct Piece {
  explicit Piece(const py::dict& d)
      : by_state(d["by_state"].cast<Array>()),
        by_parameter(d["by_parameter"].cast<Array>()),
        end_by_state(d["end_by_state"].cast<Array>()),
        end_by_parameter(d["end_by_parameter"].cast<Array>()),
        gap(d["gap"].cast<Array>()),
        residual(d["residual"].cast<Array>()),
        weight(d["weight"].cast<Array>()),
        stands(d["stands"].cast<Array>()),
        first(d["first"].cast<Indices>()),
        prior_sd(d["prior_sd"].cast<Array>()) {
    windows = first.size() - 1;
    parameters = by_parameter.shape(2);
    rows = by_parameter.shape(0);
    columns = residual.shape(2);
    if (residual.shape(0) != rows || weight.shape(0) != rows || gap.shape(0) != windows || stands.shape(0) != windows ||
        prior_sd.size() != states || first.data()[windows] - first.data()[0] != rows) {
      throw std::invalid_argument("the arrays of a piece do not fit together");
    }
  }
  Array by_state, by_parameter, end_by_state, end_by_parameter, gap, residual, weight, stands;
  Indices first;
  Array prior_sd;
  std::ptrdiff_t windows{}, parameters{}, rows{}, columns{};
};

/// Slow random factors of the rig: each is a first-order Gauss-Markov process that acts as a combination of parameters.
struct Disturbed {
  ConstMap directions;  // (disturbances, parameters)
  const double* sd;     // stationary
  const double* time_constant_s;
};

/// One scalar reading, as the filter saw it.
struct Reading {
  Row sensitivity;
  State gain;
  double innovation;
  double variance;
};

struct Filtered {
  Rows normal;             // (parameters, parameters)
  Rows right;              // (parameters, columns)
  Eigen::VectorXd square;  // (columns): sum of squared innovations over their variance
  double log_variance{0.0};
  double readings{0.0};
};

struct Kept {
  std::vector<Reading> readings;
  std::vector<std::ptrdiff_t> last_reading;  // of each window: index after it
  std::vector<State> predicted;
  std::vector<Covariance> covariance;
  std::vector<Covariance> transition;
};

/// The Kalman filter over one piece. The estimate of the state is affine in the change of the parameters, and so is
/// each innovation: the normal equations of the parameters follow from one pass. `kept` is for `smooth`, with no
/// parameters' columns used.
Filtered filter(const Piece& piece, const double* time_s, const Disturbed& disturbed, double variance, Kept* kept) {
  const std::ptrdiff_t p = piece.parameters;
  const std::ptrdiff_t c = piece.columns;
  Filtered out;
  out.normal = Rows::Zero(p, p);
  out.right = Rows::Zero(p, c);
  out.square = Eigen::VectorXd::Zero(c);
  Covariance P = Covariance::Zero();
  Rows X = Rows::Zero(size, c + p);  // state: the first c columns for each residual, then by parameter
  for (int i = 0; i < states; ++i) P(i, i) = piece.prior_sd.data()[i] * piece.prior_sd.data()[i];
  for (int i = 0; i < disturbances; ++i) P(states + i, states + i) = disturbed.sd[i] * disturbed.sd[i];
  Rows b(1, c + p);
  const std::ptrdiff_t origin = piece.first.data()[0];
  const Eigen::MatrixXd into = disturbed.directions.transpose();  // (parameters, disturbances)
  for (std::ptrdiff_t w = 0; w < piece.windows; ++w) {
    const double* stands = piece.stands.data() + w * angles;
    for (int i = 0; i < 2; ++i) {
      if (stands[i] == 0.0) continue;
      P.row(angles + i).setZero();
      P.col(angles + i).setZero();
      X.row(angles + i).setZero();
    }
    if (kept != nullptr) {
      kept->predicted.push_back(X.col(0));
      kept->covariance.push_back(P);
    }
    for (std::ptrdiff_t row = piece.first.data()[w] - origin; row < piece.first.data()[w + 1] - origin; ++row) {
      for (std::ptrdiff_t wheel = 0; wheel < angles; ++wheel) {
        const std::ptrdiff_t at = row * angles + wheel;
        const double weight = piece.weight.data()[at];
        if (!(weight > 0.0)) continue;
        const ConstMap D(piece.by_parameter.data() + at * p, 1, p);
        Row H = Row::Zero();
        H(wheel) = 1.0;
        for (int i = 0; i < moving; ++i) H(angles + i) = piece.by_state.data()[at * moving + i];
        H.tail<disturbances>() = D * into;
        const State PH = P * H.transpose();
        const double S = H.dot(PH.transpose()) + variance / weight;
        const State K = PH / S;
        b.noalias() = -H * X;
        for (std::ptrdiff_t i = 0; i < c; ++i) b(i) += piece.residual.data()[at * c + i];
        b.rightCols(p) -= D;
        X.noalias() += K * b;
        P.noalias() -= K * PH.transpose();
        out.normal.noalias() += b.rightCols(p).transpose() * b.rightCols(p) / S;
        out.right.noalias() -= b.rightCols(p).transpose() * b.leftCols(c) / S;
        out.square += b.leftCols(c).cwiseAbs2().transpose() / S;
        out.log_variance += std::log(S);
        out.readings += weight;
        if (kept != nullptr) kept->readings.push_back({H, K, b(0), S});
      }
    }
    P = 0.5 * (P + P.transpose()).eval();
    const double duration_s = time_s[piece.first.data()[w + 1]] - time_s[piece.first.data()[w]];
    Covariance F = Covariance::Zero();
    F(0, 0) = F(1, 1) = 1.0;
    for (int i = 0; i < states; ++i) {
      for (int j = 0; j < moving; ++j) F(i, angles + j) = piece.end_by_state.data()[(w * states + i) * moving + j];
    }
    const ConstMap G(piece.end_by_parameter.data() + w * states * p, states, p);
    F.topRightCorner<states, disturbances>() = G * into;
    Covariance Q = Covariance::Zero();
    for (int i = 0; i < disturbances; ++i) {
      const double keeps = std::exp(-duration_s / disturbed.time_constant_s[i]);
      F(states + i, states + i) = keeps;
      Q(states + i, states + i) = (1.0 - keeps * keeps) * disturbed.sd[i] * disturbed.sd[i];
    }
    X = F * X;
    for (int i = 0; i < states; ++i) X(i, 0) += piece.gap.data()[w * states + i];
    X.topRightCorner(states, p) += G;
    P = F * P * F.transpose() + Q;
    if (kept != nullptr) {
      kept->transition.push_back(F);
      kept->last_reading.push_back(static_cast<std::ptrdiff_t>(kept->readings.size()));
    }
  }
  return out;
}

py::tuple filter_pieces(const py::list& pieces, const Array& directions, const Array& sd, const Array& time_constant_s,
                        double variance) {
  if (directions.shape(0) != disturbances || sd.size() != disturbances || time_constant_s.size() != disturbances) {
    throw std::invalid_argument("give five disturbances");
  }
  py::list all;
  for (const py::handle item : pieces) {
    const auto d = item.cast<py::dict>();
    const Piece piece(d);
    const auto time_s = d["time_s"].cast<Array>();
    const Disturbed disturbed{ConstMap(directions.data(), disturbances, directions.shape(1)), sd.data(),
                              time_constant_s.data()};
    Filtered one;
    {
      const py::gil_scoped_release release;
      one = filter(piece, time_s.data(), disturbed, variance, nullptr);
    }
    all.append(py::make_tuple(one.normal, one.right, one.square, one.log_variance, one.readings));
  }
  return py::tuple(all);
}

/// The most likely changes of state at the windows' starts, shape (windows, 10): the five of the plant and the
/// disturbances. The residual's only column and the gaps must contain the change of the parameters already. The
/// backward pass (modified Bryson-Frazier) inverts no covariance: a standing wheel's is singular. Also the innovations
/// over their standard deviations, in order of the readings.
py::tuple smooth(const py::dict& d, const Array& directions, const Array& sd, const Array& time_constant_s,
                 double variance) {
  const Piece piece(d);
  const auto time_s = d["time_s"].cast<Array>();
  const Disturbed disturbed{ConstMap(directions.data(), disturbances, directions.shape(1)), sd.data(),
                            time_constant_s.data()};
  Array states_at({piece.windows, static_cast<std::ptrdiff_t>(size)});
  std::vector<double> innovations;
  double* const to = states_at.mutable_data();
  {
    const py::gil_scoped_release release;
    Kept kept;
    filter(piece, time_s.data(), disturbed, variance, &kept);
    for (const Reading& r : kept.readings) innovations.push_back(r.innovation / std::sqrt(r.variance));
    State adjoint = State::Zero();
    for (std::ptrdiff_t w = piece.windows - 1; w >= 0; --w) {
      const auto at = static_cast<std::size_t>(w);
      adjoint = (kept.transition[at].transpose() * adjoint).eval();
      const std::ptrdiff_t begin = w == 0 ? 0 : kept.last_reading[at - 1];
      for (std::ptrdiff_t i = kept.last_reading[at] - 1; i >= begin; --i) {
        const Reading& r = kept.readings[static_cast<std::size_t>(i)];
        adjoint += r.sensitivity.transpose() * (r.innovation / r.variance - r.gain.dot(adjoint));
      }
      const State best = kept.predicted[at] + kept.covariance[at] * adjoint;
      std::copy_n(best.data(), size, to + w * size);
      for (int i = 0; i < 2; ++i) {
        if (piece.stands.data()[w * angles + i] != 0.0) adjoint(angles + i) = 0.0;
      }
    }
  }
  py::array_t<double> values(static_cast<py::ssize_t>(innovations.size()), innovations.data());
  return py::make_tuple(states_at, values);
}

}  // namespace

void add_identification_filter(py::module_& module) {
  module.def("filter_pieces", &filter_pieces, py::arg("pieces"), py::arg("directions"), py::arg("sd"),
             py::arg("time_constant_s"), py::arg("variance"));
  module.def("smooth", &smooth, py::arg("piece"), py::arg("directions"), py::arg("sd"), py::arg("time_constant_s"),
             py::arg("variance"));
}

}  // namespace abs_hil::python
