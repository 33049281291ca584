// abs_hil._core: the C++ that the Python package is made of, which is the simulation core (cmake/Core.cmake). Its
// docstrings are those of the package around it.

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>

#include "abs_hil/driver/io_result.hpp"
#include "bindings.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "files/result_file.hpp"
#include "injection/injecting_driver.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/event_log.hpp"
#include "version/build_facts.hpp"

namespace {

using namespace abs_hil;

/// Bad input is a ValueError, with the program's own text; what the computer cannot give is an OSError.
void translate(std::exception_ptr error) {
  try {
    if (error) std::rethrow_exception(error);
  } catch (const config::ConfigError& e) {
    PyErr_SetString(PyExc_ValueError, e.what());
  } catch (const telemetry::RecordingError& e) {
    PyErr_SetString(PyExc_ValueError, e.what());
  } catch (const run_folder::FolderError& e) {
    PyErr_SetString(PyExc_ValueError, e.what());
  } catch (const files::FileError& e) {
    PyErr_SetString(PyExc_OSError, e.what());
  } catch (const driver::Unavailable& e) {
    PyErr_SetString(PyExc_OSError, e.what());
  }
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "The C++ of abs_hil. Use the package abs_hil.";
  pybind11::register_exception_translator(&translate);
  spdlog::set_default_logger(spdlog::stderr_color_mt("abs_hil"));
  spdlog::set_level(spdlog::level::warn);
  spdlog::set_pattern("abs_hil: %l: %v");
  module.attr("version") = version::build_facts().version;
  module.attr("revision") = version::build_facts().git_revision;
  module.def("set_config_dir", [](const std::string& folder) { config::set_own_config_dir(folder); });
  module.def("config_dir", [] { return config::config_dir().string(); });
  injection::begin();
  python::add_controllers(module);
  python::add_plant(module);
  python::add_simulation(module);
  python::add_episodes(module);
  python::add_studies(module);
  python::add_files(module);
  python::add_fmus(module);
  python::add_identification(module);
  python::add_identification_filter(module);
  python::add_tables(module);
}
