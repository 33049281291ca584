#pragma once

#include <pybind11/pybind11.h>

#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "abs_hil/rig/state_bytes.hpp"
#include "config/merge.hpp"

namespace abs_hil::python {

namespace py = pybind11;

// Each adds its functions and classes to the module abs_hil._core.
void add_controllers(py::module_& module);
void add_episodes(py::module_& module);
void add_files(py::module_& module);
void add_fmus(py::module_& module);
void add_identification(py::module_& module);
void add_identification_filter(py::module_& module);
void add_plant(py::module_& module);
void add_simulation(py::module_& module);
void add_studies(py::module_& module);
void add_tables(py::module_& module);

/// The options of a run from the arguments of abs_hil.simulate: text, or lists of text.
[[nodiscard]] config::Sources run_options(const py::dict& arguments);

class PythonControllerScope;
/// Makes the run that `request` makes, outside of Python's lock: its columns, its signals, its summary as JSON, its
/// configuration as TOML. @param scope  of a controller in Python, or null
[[nodiscard]] py::tuple recorded_run(const std::function<config::Configuration()>& request,
                                     PythonControllerScope* scope);

/// A NumPy array that takes over the values.
template <class Value>
[[nodiscard]] py::object array_of(std::vector<Value> values);

/// The name under which the registry of controllers has those that are written in Python.
inline constexpr const char* python_controller = "python";

/// While it lives, the registry makes controllers of this thread that call the object. Then `rethrow` raises what it
/// raised.
class PythonControllerScope {
 public:
  explicit PythonControllerScope(py::object controller);
  PythonControllerScope(const PythonControllerScope&) = delete;
  PythonControllerScope& operator=(const PythonControllerScope&) = delete;
  ~PythonControllerScope();
  void rethrow() const;
  [[nodiscard]] std::exception_ptr raised() const noexcept;
  [[nodiscard]] bool failed() const noexcept;

 private:
  py::object controller_;
};

/// The methods state_bytes and take_state_bytes of a class with `exchange_state`, for copies and pickles.
template <class Class>
void add_state_bytes(py::class_<Class>& type) {
  type.def("state_bytes",
           [](Class& self) {
             rig::StateBytes bytes;
             self.exchange_state(bytes);
             return py::bytes(bytes.written());
           })
      .def("take_state_bytes", [](Class& self, const std::string& kept) {
        rig::StateBytes bytes(kept);
        self.exchange_state(bytes);
        bytes.end();
      });
}

}  // namespace abs_hil::python
