#pragma once

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "array.hpp"
#include "bindings.hpp"

/// Plants and inputs of a log, as identification simulates them.
namespace abs_hil::python {

using plant_sim::Plant;
using plant_sim::PlantOptions;
using plant_sim::PlantState;

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

using Values = std::vector<std::pair<std::string, double>>;

/// The options with other values for some numbers, named as in the configuration without "plant.". `delay_s` is not one
/// of them and is left to the caller.
inline PlantOptions with(const PlantOptions& options, const Values& values) {
  PlantOptions changed = options;
  for (const auto& [wanted, value] : values) {
    bool found = false;
    rig::for_each_option(changed, "", [&](const std::string& name, const rig::OptionFacts&, auto& target) {
      if constexpr (std::is_same_v<std::remove_reference_t<decltype(target)>, double>) {
        if (name == wanted) {
          target = value;
          found = true;
        }
      }
    });
    if (!found) throw std::invalid_argument("plant." + wanted + ": no number of the plant has this name");
  }
  plant_sim::check(changed);
  return changed;
}

// ---- the inputs of a log

/// What acted on the rig: row n's duties act from `time_s[n]`, later by `delay_s`, to the next row's. Until then those
/// of `brake_before` and `motor_before` act, or, without these, the duties of the row before.
struct Inputs {
  explicit Inputs(const py::dict& log)
      : time_s(log["time_s"].cast<Array>()),
        brake_pwm(log["brake_pwm"].cast<Array>()),
        motor_pwm(log["motor_pwm"].cast<Array>()),
        wheels_apart(log["wheels_apart"].cast<Array>()) {
    late = log.contains("brake_before");
    if (late) {
      brake_before = log["brake_before"].cast<Array>();
      motor_before = log["motor_before"].cast<Array>();
    }
    for (const Array* column : {&brake_pwm, &motor_pwm, &wheels_apart, &brake_before, &motor_before}) {
      if (column->size() != time_s.size() && (late || column->size() > 0))
        throw std::invalid_argument("the log's columns differ in length");
    }
  }
  [[nodiscard]] std::ptrdiff_t rows() const { return time_s.size(); }
  [[nodiscard]] plant_sim::PlantInput at(std::ptrdiff_t row) const {
    return {.motor_duty = motor_pwm.data()[row], .brake_duty = brake_pwm.data()[row]};
  }
  [[nodiscard]] plant_sim::PlantInput before(std::ptrdiff_t row) const {
    if (!late) return at(row > 0 ? row - 1 : row);
    return {.motor_duty = motor_before.data()[row], .brake_duty = brake_before.data()[row]};
  }
  [[nodiscard]] bool apart(std::ptrdiff_t row) const { return wheels_apart.data()[row] != 0.0; }

  Array time_s, brake_pwm, motor_pwm, wheels_apart;
  Array brake_before{}, motor_before{};
  bool late{false};
};

/// A plant whose inputs come late.
struct DelayedPlant {
  DelayedPlant(const PlantOptions& base, Values values) : delay_s(taken_delay(values)), plant(with(base, values)) {}

  static double taken_delay(Values& values) {
    double delay = 0.0;
    std::erase_if(values, [&delay](const auto& value) {
      if (value.first != "delay_s") return false;
      delay = value.second;
      return true;
    });
    return delay;
  }
  /// From row to row + 1.
  void advance(const Inputs& inputs, std::ptrdiff_t row) {
    const double interval_s = inputs.time_s.data()[row + 1] - inputs.time_s.data()[row];
    const plant_sim::PlantInput now = inputs.at(row), before = inputs.before(row);
    const bool same = before.motor_duty == now.motor_duty && before.brake_duty == now.brake_duty;
    const double late_s = same ? 0.0 : std::min(delay_s, interval_s);
    plant.part_wheels(inputs.apart(row));
    if (late_s > 0.0) plant.advance(late_s, before);
    if (interval_s > late_s) plant.advance(interval_s - late_s, now);
  }

  double delay_s;
  Plant plant;
};

constexpr std::ptrdiff_t states = 5;  // angle1, angle2, omega1, omega2, brake torque
constexpr std::ptrdiff_t angles = 2;
constexpr std::ptrdiff_t moving = states - angles;  // those that the motion depends on: the angles only add up

inline std::array<double, states> values_of(const PlantState& s) {
  return {s.angle1_rad, s.angle2_rad, s.omega1_rad_s, s.omega2_rad_s, s.brake_torque_Nm};
}

}  // namespace abs_hil::python
