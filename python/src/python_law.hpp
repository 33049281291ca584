// What a controller in Python gives, judged alike in this process and in one of its own.
#pragma once

#include <pybind11/pybind11.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::python {

/// What its `step` returned. Throws TypeError for what is neither a number nor an abs_hil.SlipOutput.
inline control::SlipOutput law_output(const pybind11::object& returned) {
  if (pybind11::isinstance<control::SlipOutput>(returned)) return pybind11::cast<control::SlipOutput>(returned);
  control::SlipOutput output{
      .brake_torque_Nm = rig::unknown, .slip_velocity_error_m_s = rig::unknown, .theta_est_N = rig::unknown};
  output.brake_torque_Nm = PyFloat_AsDouble(returned.ptr());
  if (PyErr_Occurred() == nullptr) return output;
  PyErr_Clear();
  throw pybind11::type_error("the controller's step returned " + std::string(pybind11::repr(returned)) +
                             "; give the wanted brake torque in N m, a number, or an abs_hil.SlipOutput");
}

/// Name and meaning of its signals, if it has some. Throws std::invalid_argument for other `signals` than texts by
/// name.
inline std::vector<std::pair<std::string, std::string>> law_signals(const pybind11::object& law) {
  std::vector<std::pair<std::string, std::string>> found;
  const pybind11::object given = pybind11::getattr(law, "signals", pybind11::dict());
  const auto refuse_signals = [&] {
    throw std::invalid_argument("the controller's signals are " + std::string(pybind11::repr(given)) +
                                "; give a dictionary of texts, as {\"name\": \"meaning\"}");
  };
  if (!pybind11::isinstance<pybind11::dict>(given)) refuse_signals();
  for (const auto& [name, meaning] : pybind11::reinterpret_borrow<pybind11::dict>(given)) {
    if (!pybind11::isinstance<pybind11::str>(name) || !pybind11::isinstance<pybind11::str>(meaning)) refuse_signals();
    found.emplace_back(pybind11::cast<std::string>(name), pybind11::cast<std::string>(meaning));
  }
  return found;
}

}  // namespace abs_hil::python
