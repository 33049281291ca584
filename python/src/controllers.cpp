// Slip controllers: those of the registry stepped by hand, and controllers written in Python.

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "bindings.hpp"
#include "python_law.hpp"

namespace abs_hil::python {

namespace {

using control::SlipInput;
using control::SlipOutput;

/// What a run knows of its controller in Python. A run stays in one thread.
struct Current {
  py::object* controller{nullptr};
  std::exception_ptr error{};
};
/// The runs of this thread, the innermost last: a controller may itself simulate.
thread_local std::vector<Current> runs;

/// Calls a Python object. An exception is kept, and from then on the torque is NaN: the gate ends the run with the
/// fault controller_not_finite before it acts.
class PythonController final : public control::SlipController {
 public:
  explicit PythonController(const py::object& controller) : controller_(controller) {
    const py::gil_scoped_acquire gil;
    texts_ = law_signals(controller_);
    for (const auto& [name, meaning] : texts_) signals_.push_back({name, meaning});
  }
  PythonController(const PythonController&) = delete;
  PythonController& operator=(const PythonController&) = delete;
  ~PythonController() override {
    const py::gil_scoped_acquire gil;
    controller_ = py::object();
  }

  void reset(const SlipInput& input) noexcept override {
    call([&] { controller_.attr("reset")(input); });
  }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override {
    SlipOutput output{
        .brake_torque_Nm = rig::unknown, .slip_velocity_error_m_s = rig::unknown, .theta_est_N = rig::unknown};
    call([&] { output = law_output(controller_.attr("step")(input)); });
    return output;
  }
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override { return signals_; }

 private:
  template <class Call>
  void call(const Call& function) noexcept {
    if (runs.empty() || runs.back().error) return;
    const py::gil_scoped_acquire gil;
    try {
      function();
    } catch (py::error_already_set& error) {
      // Passed on, it would end the calling program, and with the status of its choice.
      runs.back().error = error.matches(PyExc_SystemExit)
                              ? std::make_exception_ptr(std::runtime_error("the controller asked Python to exit"))
                              : std::current_exception();
    } catch (...) {
      runs.back().error = std::current_exception();
    }
  }

  py::object controller_;
  std::vector<std::pair<std::string, std::string>> texts_{};  ///< of signals_
  std::vector<rig::Signal> signals_;
};

/// A controller of the registry with its options, to be stepped by hand.
class LawByHand {
 public:
  LawByHand(const py::dict& arguments) {
    const config::Configuration request = config::merge(run_options(arguments));
    controller_ = control::make_controller(request.settings.control.controller,
                                           {request.settings.control, request.settings.model});
    name_ = request.settings.control.controller;
  }
  void reset(const SlipInput& input) { controller_->reset(input); }
  SlipOutput step(const SlipInput& input) { return controller_->step(input); }
  /// Throws std::invalid_argument for a law that cannot.
  void exchange_state(rig::StateBytes& state) {
    if (controller_->exchange_state(state)) return;
    throw std::invalid_argument("controller " + name_ + ": its state cannot be copied or pickled; those of " +
                                "abs_hil.controllers() can");
  }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] py::dict signals() const {
    py::dict signals;
    for (const rig::Signal& signal : controller_->signals())
      signals[py::str(signal.name.data(), signal.name.size())] = std::string(signal.meaning);
    return signals;
  }

 private:
  std::unique_ptr<control::SlipController> controller_;
  std::string name_;
};

void add_input(py::module_& module) {
  py::class_<SlipInput>(module, "SlipInput")
      .def(py::init([](double dt_s, double omega1_rad_s, double omega2_rad_s, double slip, double slip_ref,
                       double brake_torque_Nm, double max_brake_torque_Nm, double mean_brake_torque_Nm,
                       double alpha1_rad_s2, double alpha2_rad_s2, double upper_travel_rad, double lower_travel_rad,
                       double sent_brake_torque_Nm, double unsent_torque_Nm) {
             return SlipInput{.dt_s = dt_s,
                              .speeds = {omega1_rad_s, omega2_rad_s},
                              .slip = slip,
                              .slip_ref = slip_ref,
                              .mean_brake_torque_Nm = mean_brake_torque_Nm,
                              .brake_torque_Nm = brake_torque_Nm,
                              .max_brake_torque_Nm = max_brake_torque_Nm,
                              .alpha1_rad_s2 = alpha1_rad_s2,
                              .alpha2_rad_s2 = alpha2_rad_s2,
                              .upper_travel_rad = upper_travel_rad,
                              .lower_travel_rad = lower_travel_rad,
                              .sent_brake_torque_Nm = sent_brake_torque_Nm,
                              .unsent_torque_Nm = unsent_torque_Nm};
           }),
           py::kw_only(), py::arg("dt_s"), py::arg("omega1_rad_s"), py::arg("omega2_rad_s"), py::arg("slip"),
           py::arg("slip_ref"), py::arg("brake_torque_Nm") = 0.0, py::arg("max_brake_torque_Nm"),
           py::arg("mean_brake_torque_Nm") = 0.0, py::arg("alpha1_rad_s2") = 0.0, py::arg("alpha2_rad_s2") = 0.0,
           py::arg("upper_travel_rad") = rig::unknown, py::arg("lower_travel_rad") = rig::unknown,
           py::arg("sent_brake_torque_Nm") = 0.0, py::arg("unsent_torque_Nm") = 0.0)
      .def_readonly("dt_s", &SlipInput::dt_s, "time since the previous step, s")
      .def_property_readonly(
          "omega1_rad_s", [](const SlipInput& i) { return i.speeds.omega1_rad_s; }, "estimated speed, rad/s")
      .def_property_readonly(
          "omega2_rad_s", [](const SlipInput& i) { return i.speeds.omega2_rad_s; }, "estimated speed, rad/s")
      .def_readonly("slip", &SlipInput::slip, "estimated slip")
      .def_readonly("slip_ref", &SlipInput::slip_ref, "its reference")
      .def_readonly("mean_brake_torque_Nm", &SlipInput::mean_brake_torque_Nm,
                    "mean of the torque over the past interval, N m")
      .def_readonly("brake_torque_Nm", &SlipInput::brake_torque_Nm, "torque estimated to act now, N m")
      .def_readonly("max_brake_torque_Nm", &SlipInput::max_brake_torque_Nm,
                    "the largest that the actuator can give, N m")
      .def_readonly("alpha1_rad_s2", &SlipInput::alpha1_rad_s2, "estimated acceleration of the upper wheel, rad/s^2")
      .def_readonly("alpha2_rad_s2", &SlipInput::alpha2_rad_s2, "estimated acceleration of the lower wheel, rad/s^2")
      .def_readonly("upper_travel_rad", &SlipInput::upper_travel_rad,
                    "angle over the past interval, rad; NaN if unknown")
      .def_readonly("lower_travel_rad", &SlipInput::lower_travel_rad,
                    "angle over the past interval, rad; NaN if unknown")
      .def_readonly("sent_brake_torque_Nm", &SlipInput::sent_brake_torque_Nm,
                    "static torque sent in the previous cycle, N m")
      .def_readonly("unsent_torque_Nm", &SlipInput::unsent_torque_Nm, "what was missing in it, N m")
      .def("__repr__", [](const SlipInput& i) {
        return fmt::format("SlipInput(dt_s={}, omega1_rad_s={}, omega2_rad_s={}, slip={}, slip_ref={}, ...)", i.dt_s,
                           i.speeds.omega1_rad_s, i.speeds.omega2_rad_s, i.slip, i.slip_ref);
      });
}

void add_output(py::module_& module) {
  py::class_<SlipOutput>(module, "SlipOutput")
      .def(py::init([](double brake_torque_Nm, double slip_velocity_error_m_s, double theta_est_N, double slip_ref,
                       const std::vector<double>& signals) {
             SlipOutput output{.brake_torque_Nm = brake_torque_Nm,
                               .slip_velocity_error_m_s = slip_velocity_error_m_s,
                               .theta_est_N = theta_est_N,
                               .slip_ref = slip_ref};
             if (signals.size() > rig::signal_max) {
               throw std::invalid_argument("signals: " + std::to_string(signals.size()) + " values; give at most " +
                                           std::to_string(rig::signal_max));
             }
             std::copy(signals.begin(), signals.end(), output.signals.begin());
             return output;
           }),
           py::arg("brake_torque_Nm"), py::kw_only(), py::arg("slip_velocity_error_m_s") = rig::unknown,
           py::arg("theta_est_N") = rig::unknown, py::arg("slip_ref") = rig::unknown,
           py::arg("signals") = std::vector<double>())
      .def_readonly("brake_torque_Nm", &SlipOutput::brake_torque_Nm, "wanted static torque, N m")
      .def_readonly("slip_velocity_error_m_s", &SlipOutput::slip_velocity_error_m_s,
                    "error of the slip velocity, m/s; NaN if the controller gives none")
      .def_readonly("theta_est_N", &SlipOutput::theta_est_N, "estimated peak tyre force, N; NaN if none")
      .def_readonly("slip_ref", &SlipOutput::slip_ref, "own reference of slip; NaN if none")
      .def_property_readonly(
          "signals", [](const SlipOutput& o) { return std::vector<double>(o.signals.begin(), o.signals.end()); },
          "values of the controller's own signals")
      .def("__repr__", [](const SlipOutput& o) {
        return fmt::format("SlipOutput({}, slip_velocity_error_m_s={}, theta_est_N={}, slip_ref={})", o.brake_torque_Nm,
                           o.slip_velocity_error_m_s, o.theta_est_N, o.slip_ref);
      });
}

}  // namespace

PythonControllerScope::PythonControllerScope(py::object controller) : controller_(std::move(controller)) {
  runs.push_back({.controller = &controller_});
}
PythonControllerScope::~PythonControllerScope() { runs.pop_back(); }
bool PythonControllerScope::failed() const noexcept { return runs.back().error != nullptr; }
std::exception_ptr PythonControllerScope::raised() const noexcept { return runs.back().error; }
void PythonControllerScope::rethrow() const {
  if (runs.back().error) std::rethrow_exception(runs.back().error);
}

void add_controllers(py::module_& module) {
  add_input(module);
  add_output(module);
  py::class_<LawByHand> controller_class(module, "Controller");
  add_state_bytes(controller_class);
  controller_class.def(py::init<const py::dict&>())
      .def("reset", &LawByHand::reset, py::arg("input"))
      .def("step", &LawByHand::step, py::arg("input"))
      .def_property_readonly("name", &LawByHand::name)
      .def_property_readonly("signals", &LawByHand::signals);
  control::register_controller(
      {python_controller, "a controller written in Python",
       [](const control::ControllerContext& /*context*/) -> std::unique_ptr<control::SlipController> {
         if (runs.empty()) {
           throw std::invalid_argument(
               "controller \"python\": give the controller itself, an object with the methods "
               "reset and step");
         }
         return std::make_unique<PythonController>(*runs.back().controller);
       }});
}

}  // namespace abs_hil::python
