// What identification (python/abs_hil/identification) computes many times: the plant's sensitivities over a log.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "bindings.hpp"

namespace abs_hil::python {

namespace {

using plant_sim::Plant;
using plant_sim::PlantOptions;
using plant_sim::PlantState;

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

using Values = std::vector<std::pair<std::string, double>>;

/// The options with other values for some numbers, named as in the configuration without "plant.". `delay_s` is not one
/// of them and is left to the caller.
PlantOptions with(const PlantOptions& options, const Values& values) {
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

/// What acted on the rig: row n's duties act from `time_s[n]`, later by `delay_s`, to the next row's.
struct Inputs {
  explicit Inputs(const py::dict& log)
      : time_s(log["time_s"].cast<Array>()),
        brake_pwm(log["brake_pwm"].cast<Array>()),
        motor_pwm(log["motor_pwm"].cast<Array>()),
        wheels_apart(log["wheels_apart"].cast<Array>()) {
    for (const Array* column : {&brake_pwm, &motor_pwm, &wheels_apart}) {
      if (column->size() != time_s.size()) throw std::invalid_argument("the log's columns differ in length");
    }
  }
  [[nodiscard]] std::ptrdiff_t rows() const { return time_s.size(); }
  [[nodiscard]] plant_sim::PlantInput at(std::ptrdiff_t row) const {
    return {.motor_duty = motor_pwm.data()[row], .brake_duty = brake_pwm.data()[row]};
  }
  [[nodiscard]] bool apart(std::ptrdiff_t row) const { return wheels_apart.data()[row] != 0.0; }

  Array time_s, brake_pwm, motor_pwm, wheels_apart;
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
    const double late_s = std::min(delay_s, interval_s);
    plant.part_wheels(inputs.apart(row));
    if (late_s > 0.0) plant.advance(late_s, inputs.at(row > 0 ? row - 1 : row));
    if (interval_s > late_s) plant.advance(interval_s - late_s, inputs.at(row));
  }

  double delay_s;
  Plant plant;
};

// ---- sensitivities

constexpr std::ptrdiff_t states = 5;  // angle1, angle2, omega1, omega2, brake torque
constexpr std::ptrdiff_t angles = 2;
constexpr std::ptrdiff_t moving = states - angles;  // those that the motion depends on: the angles only add up

std::array<double, states> values_of(const PlantState& s) {
  return {s.angle1_rad, s.angle2_rad, s.omega1_rad_s, s.omega2_rad_s, s.brake_torque_Nm};
}

/// What a parameter belongs to: windows in which that does not act need no simulation.
enum class Acts { always, in_contact, with_brake, with_motor };

Acts acts_of(const std::string& name) {
  if (name == "always") return Acts::always;
  if (name == "contact") return Acts::in_contact;
  if (name == "brake") return Acts::with_brake;
  if (name == "motor") return Acts::with_motor;
  throw std::invalid_argument("a parameter acts always, contact, brake or motor, not " + name);
}

struct Varied {
  DelayedPlant plant;
  double step;
  Acts acts;
};

struct Window {
  std::ptrdiff_t first;  // row
  std::ptrdiff_t last;   // row at which the next window begins
  bool contact{false};
  bool brake{false};
  bool motor{false};
};

Window window_of(const Inputs& inputs, std::ptrdiff_t first, std::ptrdiff_t last, double brake_torque_Nm) {
  if (first < 0 || last <= first || last >= inputs.rows()) throw std::invalid_argument("a window outside its log");
  Window window{first, last, false, brake_torque_Nm > 1e-9, false};
  for (std::ptrdiff_t row = std::max<std::ptrdiff_t>(first - 1, 0); row < last; ++row) {
    const plant_sim::PlantInput input = inputs.at(row);
    window.contact = window.contact || !inputs.apart(row);
    window.brake = window.brake || input.brake_duty > 0.0;
    window.motor = window.motor || input.motor_duty > 0.0;
  }
  return window;
}

bool is_needed(Acts acts, const Window& window) {
  switch (acts) {
    case Acts::in_contact: return window.contact;
    case Acts::with_brake: return window.brake;
    case Acts::with_motor: return window.motor;
    case Acts::always: break;
  }
  return true;
}

/// Where the plant goes from `start`: calls `keep(row, angle1, angle2)` at each row of the window, returns the end.
template <class Keep>
std::array<double, states> run(DelayedPlant& plant, const Inputs& inputs, const Window& window, const double* start,
                               const Keep& keep) {
  plant.plant.reset({start[0], start[1], start[2], start[3], start[4]});
  for (std::ptrdiff_t row = window.first; row < window.last; ++row) {
    const PlantState& s = plant.plant.state();
    keep(row, s.angle1_rad, s.angle2_rad);
    plant.advance(inputs, row);
  }
  return values_of(plant.plant.state());
}

/// Simulates each window from its own start and differentiates it. `first` has windows + 1 rows: window w has the rows
/// from first[w] to first[w + 1] - 1. Shapes: `angles` (rows, 2) from the first window's first row on; `by_state`
/// (rows, 2, 3): derivatives by omega1, omega2 and brake torque at the window's start; `by_parameter` (rows, 2,
/// parameters); `end` (windows, 5); `end_by_state` (windows, 5, 3); `end_by_parameter` (windows, 5, parameters).
/// `wanted` chooses the windows; of the others `angles` and the like stay 0.
py::dict linearise(const PlantOptions& base, const Values& nominal, const py::list& parameters, const py::dict& log,
                   const Indices& first, const Array& starts) {
  const Inputs inputs(log);
  DelayedPlant plant(base, nominal);
  std::vector<Varied> varied;
  for (const py::handle item : parameters) {
    const auto parameter = item.cast<py::tuple>();  // values, step, acts
    varied.push_back({DelayedPlant(base, parameter[0].cast<Values>()), parameter[1].cast<double>(),
                      acts_of(parameter[2].cast<std::string>())});
  }
  const auto count = static_cast<std::ptrdiff_t>(varied.size());
  const std::ptrdiff_t windows = first.size() - 1;
  if (windows < 1 || starts.ndim() != 2 || starts.shape(0) != windows || starts.shape(1) != states) {
    throw std::invalid_argument("give one start of five values for each window");
  }
  const std::ptrdiff_t origin = first.data()[0];
  const std::ptrdiff_t rows = first.data()[windows] - origin;
  Array angle({rows, angles});
  Array by_state({rows, angles, moving});
  Array by_parameter({rows, angles, count});
  Array end({windows, states});
  Array end_by_state({windows, states, moving});
  Array end_by_parameter({windows, states, count});
  double* const angle_at = angle.mutable_data();
  double* const by_state_at = by_state.mutable_data();
  double* const by_parameter_at = by_parameter.mutable_data();
  std::fill_n(by_parameter_at, by_parameter.size(), 0.0);
  double* const end_at = end.mutable_data();
  double* const end_by_state_at = end_by_state.mutable_data();
  double* const end_by_parameter_at = end_by_parameter.mutable_data();
  std::fill_n(end_by_parameter_at, end_by_parameter.size(), 0.0);
  {
    const py::gil_scoped_release release;
    for (std::ptrdiff_t w = 0; w < windows; ++w) {
      const double* start = starts.data() + w * states;
      Window window = window_of(inputs, first.data()[w], first.data()[w + 1], start[4]);
      const auto ends = run(plant, inputs, window, start, [&](std::ptrdiff_t row, double a1, double a2) {
        angle_at[(row - origin) * angles] = a1;
        angle_at[(row - origin) * angles + 1] = a2;
      });
      std::copy(ends.begin(), ends.end(), end_at + w * states);
      const auto differentiate = [&](DelayedPlant& other, const double* from, double step, double* rows_at,
                                     double* ends_at, std::ptrdiff_t columns, std::ptrdiff_t column) {
        const auto moved = run(other, inputs, window, from, [&](std::ptrdiff_t row, double a1, double a2) {
          const std::ptrdiff_t at = (row - origin) * angles;
          rows_at[at * columns + column] = (a1 - angle_at[at]) / step;
          rows_at[(at + 1) * columns + column] = (a2 - angle_at[at + 1]) / step;
        });
        for (std::ptrdiff_t i = 0; i < states; ++i) {
          ends_at[(w * states + i) * columns + column] = (moved[i] - ends[i]) / step;
        }
      };
      for (std::ptrdiff_t i = 0; i < moving; ++i) {
        std::array<double, states> from{start[0], start[1], start[2], start[3], start[4]};
        const double step = 1e-5 * std::max(1.0, std::abs(from[angles + i]));
        from[angles + i] += step;
        differentiate(plant, from.data(), step, by_state_at, end_by_state_at, moving, i);
      }
      for (std::ptrdiff_t i = 0; i < count; ++i) {
        Varied& one = varied[static_cast<std::size_t>(i)];
        if (is_needed(one.acts, window)) {
          differentiate(one.plant, start, one.step, by_parameter_at, end_by_parameter_at, count, i);
        }
      }
    }
  }
  py::dict result;
  result["angles"] = angle;
  result["by_state"] = by_state;
  result["by_parameter"] = by_parameter;
  result["end"] = end;
  result["end_by_state"] = end_by_state;
  result["end_by_parameter"] = end_by_parameter;
  return result;
}

/// The states over a whole log from one start: shape (rows, 5).
Array trajectory(const PlantOptions& base, const Values& nominal, const py::dict& log, const Array& start) {
  const Inputs inputs(log);
  if (start.size() != states) throw std::invalid_argument("give a start of five values");
  DelayedPlant plant(base, nominal);
  Array all({inputs.rows(), states});
  double* const at = all.mutable_data();
  const double* from = start.data();
  const py::gil_scoped_release release;
  plant.plant.reset({from[0], from[1], from[2], from[3], from[4]});
  for (std::ptrdiff_t row = 0; row < inputs.rows(); ++row) {
    const auto values = values_of(plant.plant.state());
    std::copy(values.begin(), values.end(), at + row * states);
    if (row + 1 < inputs.rows()) plant.advance(inputs, row);
  }
  return all;
}

/// Tyre forces at given speeds and brake torques, N.
Array tyre_forces_N(const PlantOptions& base, const Values& values, const Array& omega1, const Array& omega2,
                    const Array& brake_torque) {
  Plant plant(with(base, values));
  if (omega2.size() != omega1.size() || brake_torque.size() != omega1.size()) {
    throw std::invalid_argument("the arrays differ in length");
  }
  Array forces(omega1.size());
  for (std::ptrdiff_t i = 0; i < omega1.size(); ++i) {
    plant.reset({0.0, 0.0, omega1.data()[i], omega2.data()[i], brake_torque.data()[i]});
    forces.mutable_data()[i] = plant.tyre_force_N();
  }
  return forces;
}

}  // namespace

void add_identification(py::module_& module) {
  py::class_<PlantOptions>(module, "PlantOptions")
      .def(py::init([](const py::dict& arguments) { return program::merged_settings(run_options(arguments)).plant; }))
      .def("with_values", [](const PlantOptions& options, const Values& values) { return with(options, values); })
      .def("values", [](const PlantOptions& options) {
        py::dict all;
        PlantOptions copy = options;
        rig::for_each_option(copy, "", [&](const std::string& name, const rig::OptionFacts&, auto& target) {
          all[py::str(name)] = py::cast(target);
        });
        return all;
      });
  module.def("linearise", &linearise, py::arg("base"), py::arg("nominal"), py::arg("parameters"), py::arg("log"),
             py::arg("first"), py::arg("starts"));
  module.def("trajectory", &trajectory, py::arg("base"), py::arg("nominal"), py::arg("log"), py::arg("start"));
  module.def("tyre_forces_N", &tyre_forces_N, py::arg("base"), py::arg("values"), py::arg("omega1_rad_s"),
             py::arg("omega2_rad_s"), py::arg("brake_torque_Nm"));
}

}  // namespace abs_hil::python
