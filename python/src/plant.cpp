// The simulated rig's plant, advanced by hand.

#include "abs_hil/plant_sim/plant.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "abs_hil/rig/brake_map.hpp"
#include "bindings.hpp"

namespace abs_hil::python {

namespace {

using plant_sim::Plant;
using plant_sim::PlantState;

plant_sim::PlantOptions options_of(const py::dict& arguments) {
  return config::merge(run_options(arguments)).settings.plant;
}

/// Throws std::invalid_argument, which Python sees as ValueError.
void check_state(const PlantState& state) {
  for (const auto& [name, value] : {std::pair{"angle1_rad", state.angle1_rad},
                                    {"angle2_rad", state.angle2_rad},
                                    {"omega1_rad_s", state.omega1_rad_s},
                                    {"omega2_rad_s", state.omega2_rad_s}}) {
    if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("{} = {}: give a finite number", name, value));
  }
  if (!(state.brake_torque_Nm >= 0.0 && std::isfinite(state.brake_torque_Nm))) {
    throw std::invalid_argument(
        fmt::format("brake_torque_Nm = {}: give a finite torque of 0 or more", state.brake_torque_Nm));
  }
}

void advance(Plant& plant, double duration_s, double motor_duty, double brake_duty, double brake_torque_Nm) {
  if (!(duration_s >= 0.0 && duration_s <= 1e6)) {
    throw std::invalid_argument(fmt::format("duration_s = {}: give seconds in [0, 1e6]", duration_s));
  }
  for (const auto& [name, duty] : {std::pair{"motor_duty", motor_duty}, {"brake_duty", brake_duty}}) {
    if (!(duty >= 0.0 && duty <= 1.0)) {
      throw std::invalid_argument(fmt::format("{} = {}: give a duty in [0, 1]", name, duty));
    }
  }
  check_state({.brake_torque_Nm = brake_torque_Nm});
  if (brake_torque_Nm != 0.0 && !plant.options().ideal_actuator) {
    throw std::invalid_argument(
        fmt::format("brake_torque_Nm = {}: this plant's brake takes a duty; give brake_duty, or make the plant with "
                    "set={{\"plant.ideal_actuator\": True}}",
                    brake_torque_Nm));
  }
  constexpr double uninterrupted_s = 5.0;  // takes a tenth of a second
  for (double left_s = duration_s; left_s > 0.0; left_s -= uninterrupted_s) {
    plant.advance(std::min(left_s, uninterrupted_s), {motor_duty, brake_duty, brake_torque_Nm});
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
}

double brake_duty_for(const Plant& plant, double torque_Nm) {
  if (!(torque_Nm >= 0.0 && std::isfinite(torque_Nm))) {
    throw std::invalid_argument(fmt::format("torque_Nm = {}: give a finite torque of 0 or more", torque_Nm));
  }
  const rig::BrakeParameters& brake = plant.options().rig.brake;
  return rig::brake_duty_for(brake, torque_Nm, rig::BrakeDuties<double>(brake, 1.0, 0));
}

constexpr const char* state_help =
    "State of the plant: angles in rad, speeds in rad/s, torque of the brake in N m. Index 1: the upper wheel. It can "
    "be copied and pickled.";

}  // namespace

void add_plant(py::module_& module) {
  py::class_<PlantState>(module, "PlantState", state_help)
      .def(py::init([](double angle1_rad, double angle2_rad, double omega1_rad_s, double omega2_rad_s,
                       double brake_torque_Nm) {
             const PlantState state{angle1_rad, angle2_rad, omega1_rad_s, omega2_rad_s, brake_torque_Nm};
             check_state(state);
             return state;
           }),
           py::kw_only(), py::arg("angle1_rad") = 0.0, py::arg("angle2_rad") = 0.0, py::arg("omega1_rad_s") = 0.0,
           py::arg("omega2_rad_s") = 0.0, py::arg("brake_torque_Nm") = 0.0)
      .def_readonly("angle1_rad", &PlantState::angle1_rad, "angle of the upper wheel, rad")
      .def_readonly("angle2_rad", &PlantState::angle2_rad, "angle of the lower wheel, rad")
      .def_readonly("omega1_rad_s", &PlantState::omega1_rad_s, "speed of the upper, braked wheel, rad/s")
      .def_readonly("omega2_rad_s", &PlantState::omega2_rad_s, "speed of the lower wheel, the road, rad/s")
      .def_readonly("brake_torque_Nm", &PlantState::brake_torque_Nm, "torque of the brake that acts, N m")
      .def("__repr__",
           [](const PlantState& s) {
             return fmt::format(
                 "PlantState(angle1_rad={}, angle2_rad={}, omega1_rad_s={}, omega2_rad_s={}, brake_torque_Nm={})",
                 s.angle1_rad, s.angle2_rad, s.omega1_rad_s, s.omega2_rad_s, s.brake_torque_Nm);
           })
      .def(py::pickle(
          [](const PlantState& s) {
            return py::make_tuple(s.angle1_rad, s.angle2_rad, s.omega1_rad_s, s.omega2_rad_s, s.brake_torque_Nm);
          },
          [](const py::tuple& t) {
            if (t.size() != 5) throw std::invalid_argument("no pickled PlantState");
            const PlantState state{t[0].cast<double>(), t[1].cast<double>(), t[2].cast<double>(), t[3].cast<double>(),
                                   t[4].cast<double>()};
            check_state(state);
            return state;
          }));
  py::class_<Plant> plant_class(module, "Plant");
  add_state_bytes(plant_class);
  plant_class.def(py::init([](const py::dict& arguments) { return Plant(options_of(arguments)); }))
      .def(
          "reset",
          [](Plant& plant, double omega1_rad_s, double omega2_rad_s, double brake_torque_Nm, double angle1_rad,
             double angle2_rad) {
            const PlantState state{angle1_rad, angle2_rad, omega1_rad_s, omega2_rad_s, brake_torque_Nm};
            check_state(state);
            plant.reset(state);
          },
          py::kw_only(), py::arg("omega1_rad_s") = 0.0, py::arg("omega2_rad_s") = 0.0, py::arg("brake_torque_Nm") = 0.0,
          py::arg("angle1_rad") = 0.0, py::arg("angle2_rad") = 0.0)
      .def("advance", &advance, py::arg("duration_s"), py::kw_only(), py::arg("motor_duty") = 0.0,
           py::arg("brake_duty") = 0.0, py::arg("brake_torque_Nm") = 0.0)
      .def("brake_duty_for", &brake_duty_for, py::arg("torque_Nm"))
      // The profiles of road and drift stay where they are.
      .def_property(
          "state", [](const Plant& plant) { return plant.state(); },
          [](Plant& plant, const PlantState& state) { plant.take_over(state, 0.0, 0); })
      .def_property_readonly("slip", &Plant::slip, "slip now: 0 rolling, 1 locked, negative driven")
      .def_property_readonly("tyre_force_N", &Plant::tyre_force_N, "force between the wheels now, N")
      .def_property_readonly(
          "theta_N", [](const Plant& plant) { return plant.truth().theta_N; },
          "the largest force that any slip could give now, N")
      .def_property_readonly("friction", &Plant::friction, "factor of the road's friction now")
      .def("__repr__", [](const Plant& plant) {
        return fmt::format("<abs_hil.Plant: omega1 {:.4g} rad/s, omega2 {:.4g} rad/s, slip {:.4g}>",
                           plant.state().omega1_rad_s, plant.state().omega2_rad_s, plant.slip());
      });
}

}  // namespace abs_hil::python
