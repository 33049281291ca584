// The simulated rig's plant, advanced by hand.

#include "abs_hil/plant_sim/plant.hpp"

#include <string>

#include "bindings.hpp"

namespace abs_hil::python {

namespace {

using plant_sim::Plant;
using plant_sim::PlantState;

plant_sim::PlantOptions options_of(const py::dict& arguments) {
  return program::merge(run_options(arguments)).settings.plant;
}

}  // namespace

void add_plant(py::module_& module) {
  py::class_<PlantState>(module, "PlantState")
      .def_readonly("angle1_rad", &PlantState::angle1_rad)
      .def_readonly("angle2_rad", &PlantState::angle2_rad)
      .def_readonly("omega1_rad_s", &PlantState::omega1_rad_s)
      .def_readonly("omega2_rad_s", &PlantState::omega2_rad_s)
      .def_readonly("brake_torque_Nm", &PlantState::brake_torque_Nm);
  py::class_<Plant>(module, "Plant")
      .def(py::init([](const py::dict& arguments) { return Plant(options_of(arguments)); }))
      .def(
          "reset",
          [](Plant& plant, double omega1_rad_s, double omega2_rad_s, double brake_torque_Nm, double angle1_rad,
             double angle2_rad) {
            plant.reset({angle1_rad, angle2_rad, omega1_rad_s, omega2_rad_s, brake_torque_Nm});
          },
          py::kw_only(), py::arg("omega1_rad_s") = 0.0, py::arg("omega2_rad_s") = 0.0, py::arg("brake_torque_Nm") = 0.0,
          py::arg("angle1_rad") = 0.0, py::arg("angle2_rad") = 0.0)
      .def(
          "advance",
          [](Plant& plant, double duration_s, double motor_duty, double brake_duty, double brake_torque_Nm) {
            if (!(duration_s >= 0.0 && duration_s <= 1e6)) {
              throw std::invalid_argument("duration_s " + std::to_string(duration_s) + ": give seconds in [0, 1e6]");
            }
            for (const double duty : {motor_duty, brake_duty}) {
              if (!(duty >= 0.0 && duty <= 1.0)) {
                throw std::invalid_argument("duty " + std::to_string(duty) + ": give a duty in [0, 1]");
              }
            }
            plant.advance(duration_s, {motor_duty, brake_duty, brake_torque_Nm});
          },
          py::arg("duration_s"), py::kw_only(), py::arg("motor_duty") = 0.0, py::arg("brake_duty") = 0.0,
          py::arg("brake_torque_Nm") = 0.0)
      .def_property_readonly("state", &Plant::state, py::return_value_policy::copy)
      .def_property_readonly("slip", &Plant::slip)
      .def_property_readonly("tyre_force_N", &Plant::tyre_force_N)
      .def_property_readonly("theta_N", [](const Plant& plant) { return plant.truth().theta_N; })
      .def_property_readonly("friction", &Plant::friction);
}

}  // namespace abs_hil::python
