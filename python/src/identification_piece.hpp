// What the filter of identification is told: a linearised piece of a log, and the slow random factors of the rig.
#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "bindings.hpp"

namespace abs_hil::python {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

constexpr std::ptrdiff_t states = 5;  // angle1, angle2, omega1, omega2, brake torque
constexpr std::ptrdiff_t angles = 2;
constexpr std::ptrdiff_t moving = states - angles;  // those that the motion depends on: the angles only add up

constexpr int disturbances = 5;
constexpr int size = states + disturbances;
using State = Eigen::Matrix<double, size, 1>;
using Covariance = Eigen::Matrix<double, size, size>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMap = Eigen::Map<const Rows>;
using Matrix = Eigen::MatrixXd;
using Wide = Eigen::Matrix<double, size, Eigen::Dynamic>;  // lazy products of these cost no packing

/// What the readings of each window say: sums over them of weight times products. A reading's row consists of its
/// derivatives by the window's state, those by the parameters, and its residuals.
struct Sums {
  explicit Sums(const py::dict& d)
      : gram(d["gram"].cast<Array>()),
        cross(d["cross"].cast<Array>()),
        square(d["square"].cast<Array>()),
        log_weight(d["log_weight"].cast<Array>()),
        readings(d["readings"].cast<Array>()) {
    windows = gram.shape(0);
    columns = cross.shape(2);
  }
  Array gram;        // (windows, states + parameters, states + parameters)
  Array cross;       // (windows, states + parameters, columns): with the residuals
  Array square;      // (windows, columns, columns): of the residuals
  Array log_weight;  // (windows): sum of the logarithms
  Array readings;    // (windows, 2): how many, and the sum of their weights
  std::ptrdiff_t windows{}, columns{};
};

/// A linearised piece of a log (`linearise`, `condense`).
struct Piece {
  explicit Piece(const py::dict& d)
      : sums(d),
        end_by_state(d["end_by_state"].cast<Array>()),
        end_by_parameter(d["end_by_parameter"].cast<Array>()),
        gap(d["gap"].cast<Array>()),
        stands(d["stands"].cast<Array>()),
        time_s(d["time_s"].cast<Array>()),
        first(d["first"].cast<Indices>()),
        prior_sd(d["prior_sd"].cast<Array>()) {
    windows = first.size() - 1;
    parameters = end_by_parameter.shape(2);
    if (sums.windows != windows || sums.gram.shape(1) != states + parameters ||
        gap.size() != windows * states * sums.columns || stands.shape(0) != windows || prior_sd.size() != states ||
        first.data()[windows] >= time_s.size()) {
      throw std::invalid_argument("the arrays of a piece do not fit together");
    }
  }
  Sums sums;
  Array end_by_state, end_by_parameter, gap, stands, time_s;
  Indices first;
  Array prior_sd;
  std::ptrdiff_t windows{}, parameters{};
};

/// Slow random factors of the rig: each is a first-order Gauss-Markov process that acts as a combination of parameters.
struct Disturbed {
  Disturbed(const Array& ways, const Array& sds, const Array& times) : sd(sds.data()), time_constant_s(times.data()) {
    if (ways.ndim() != 2 || ways.shape(0) != disturbances || sds.size() != disturbances || times.size() != disturbances)
      throw std::invalid_argument("give five disturbances");
    into = ConstMap(ways.data(), disturbances, ways.shape(1)).transpose();
    for (std::ptrdiff_t i = 0; i < into.size(); ++i) {
      const std::ptrdiff_t parameter = i % into.rows(), disturbance = i / into.rows();
      if (into(parameter, disturbance) != 0.0)
        entries.push_back({states + parameter, states + disturbance, into(parameter, disturbance)});
    }
  }
  struct Entry {
    std::ptrdiff_t row, state;
    double value;
  };
  Matrix into;                 // (parameters, disturbances)
  std::vector<Entry> entries;  // the few of it that are not 0
  const double* sd;            // stationary
  const double* time_constant_s;
};

}  // namespace abs_hil::python
