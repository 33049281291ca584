// What identification (python/abs_hil/identification) simulates: single logs and tyre forces. The sensitivities are in
// identification_sensitivities.cpp.

#include "identification_plant.hpp"
#include "plant_sim/encoder.hpp"

namespace abs_hil::python {

py::dict linearise(const PlantOptions& base, const Values& nominal, const py::list& parameters, const py::dict& log,
                   const Indices& first, const Array& starts);

namespace {

/// The states over a whole log from one start: shape (rows, 5).
Array trajectory(const PlantOptions& base, const Values& nominal, const py::dict& log, const Array& start) {
  const Inputs inputs(log);
  if (start.size() != states) throw std::invalid_argument("give a start of five values");
  DelayedPlant plant(base, nominal);
  auto all = new_array<Array>({inputs.rows(), states});
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
  auto forces = new_array<Array>({omega1.size()});
  for (std::ptrdiff_t i = 0; i < omega1.size(); ++i) {
    plant.reset({0.0, 0.0, omega1.data()[i], omega2.data()[i], brake_torque.data()[i]});
    forces.mutable_data()[i] = plant.tyre_force_N();
  }
  return forces;
}

/// What the encoders' counters hold at these angles of both wheels, shape (rows, 2).
py::array_t<std::int32_t> encoder_counts(const PlantOptions& base, const Array& angles_rad) {
  if (angles_rad.ndim() != 2 || angles_rad.shape(1) != angles) throw std::invalid_argument("give angles of two wheels");
  const plant_sim::Encoder encoders[] = {plant_sim::upper_encoder(base), plant_sim::lower_encoder(base)};
  auto counts = new_array<py::array_t<std::int32_t>>({angles_rad.shape(0), angles});
  for (std::ptrdiff_t i = 0; i < counts.size(); ++i)
    counts.mutable_data()[i] = encoders[i % angles].counts(angles_rad.data()[i], 0.0);
  return counts;
}

}  // namespace

void add_identification(py::module_& module) {
  py::class_<PlantOptions>(module, "PlantOptions")
      .def(py::init([](const py::dict& arguments) { return config::merged_settings(run_options(arguments)).plant; }))
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
  module.def("encoder_counts", &encoder_counts, py::arg("base"), py::arg("angles_rad"));
  module.def("tyre_forces_N", &tyre_forces_N, py::arg("base"), py::arg("values"), py::arg("omega1_rad_s"),
             py::arg("omega2_rad_s"), py::arg("brake_torque_Nm"));
}

}  // namespace abs_hil::python
