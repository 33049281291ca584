// abs_hil._network: what the simulation core has not. Messages of a running rig, commands to it, and controllers from
// shared libraries and FMUs. Wheels have no such module.

#include <poll.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "commands/authority.hpp"
#include "commands/receiver.hpp"
#include "commands/sender.hpp"
#include "interchange/confinement.hpp"
#include "interchange/foreign_controller.hpp"
#include "interchange/hosted_code.hpp"
#include "python_law.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace {

namespace py = pybind11;
using namespace abs_hil;

void translate(std::exception_ptr error) {
  try {
    if (error) std::rethrow_exception(error);
  } catch (const telemetry::LcmError& e) {
    PyErr_SetString(PyExc_OSError, e.what());
  }
}

/// Channels of an LCM network. Used by one thread.
class Subscription {
 public:
  Subscription(const std::string& url, const std::string& channels)
      : receiver_(url, channels, [this](const std::string& channel, std::span<const std::uint8_t> packet) {
          received_.emplace_back(channel, std::string(packet.begin(), packet.end()));
        }) {}
  /// (channel, bytes), or None after `timeout_s` without a message.
  py::object next(double timeout_s) {
    constexpr double ms_per_s = 1e3;
    constexpr double slice_ms = 100.0;
    double left_ms = timeout_s * ms_per_s;
    if (received_.empty()) receiver_.poll();
    while (received_.empty() && left_ms > 0.0) {
      const int wait_ms = static_cast<int>(std::min(left_ms, slice_ms)) + 1;
      pollfd ready{receiver_.file_descriptor(), POLLIN, 0};  // without a tcpq server -1: then poll only waits
      int heard = 0;
      {
        const py::gil_scoped_release release;
        heard = ::poll(&ready, 1, wait_ms);
      }
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      receiver_.poll();
      if (heard <= 0) left_ms -= wait_ms;
    }
    if (received_.empty()) return py::none();
    auto [channel, data] = std::move(received_.front());
    received_.pop_front();
    return py::make_tuple(channel, py::bytes(data));
  }
  /// [(channel, bytes)] of the messages that have arrived; never waits.
  py::list waiting() {
    {
      const py::gil_scoped_release release;
      receiver_.poll();
    }
    py::list messages;
    for (const auto& [channel, data] : received_) messages.append(py::make_tuple(channel, py::bytes(data)));
    received_.clear();
    return messages;
  }
  [[nodiscard]] const std::string& url() const { return receiver_.url(); }

 private:
  std::deque<std::pair<std::string, std::string>> received_;
  commands::Receiver receiver_;
};

/// Sends what `abs_hil send` sends, with the same authority. (accepted, the answer in words)
py::tuple send_command(const std::string& command, const std::string& name, double value, const std::string& url,
                       const std::string& prefix, const std::string& key_file, double timeout_s) {
  commands::Reply reply;
  {
    const py::gil_scoped_release release;
    reply = commands::send({.command = command, .name = name, .value = value},
                           {.url = url.empty() ? telemetry::default_lcm_url() : url,
                            .channel_prefix = prefix,
                            .key_file = key_file,
                            .timeout_s = timeout_s});
  }
  return py::make_tuple(reply.outcome == commands::Outcome::accepted, reply.message);
}

/// Controllers from files run in a process that lies beside the program. @param program  path of abs_hil
/// @return {ending of the files: what makes the controller}, for the registry of abs_hil._core, which is another one
py::dict controller_files(const std::string& program) {
  interchange::set_host_beside(program);
  py::dict makers;
  for (const control::ControllerFiles& files : interchange::foreign_controllers()) {
    makers[py::str(files.ending.data(), files.ending.size())] = py::capsule(reinterpret_cast<void*>(files.make));
  }
  return makers;
}

/// A controller in Python, for run_host. What its methods raise ends the process: its traceback goes to stderr, and the
/// run says in which step.
class PythonCode final : public interchange::ForeignCode {
 public:
  /// @param parts  the law and the path of its module
  explicit PythonCode(const py::tuple& parts) : reset_(parts[0].attr("reset")), step_(parts[0].attr("step")) {
    for (auto& [name, meaning] : python::law_signals(parts[0])) signals_.push_back(std::move(name));
    source_ = parts[1].cast<std::string>();
  }
  void reset(const abs_hil_input& input) noexcept override {
    ended_by_errors([&] { reset_(interchange::slip_input(input)); });
  }
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override {
    ended_by_errors(
        [&] { output = interchange::foreign_output(python::law_output(step_(interchange::slip_input(input)))); });
  }

 private:
  template <class Call>
  static void ended_by_errors(const Call& call) noexcept {
    try {
      call();
    } catch (py::error_already_set& error) {
      error.restore();
      PyErr_PrintEx(0);  // of a SystemExit it ends the process itself
      ::_exit(1);
    } catch (const std::exception& error) {
      static_cast<void>(std::fprintf(stderr, "%s\n", error.what()));
      ::_exit(1);
    }
  }

  py::object reset_, step_;
};

/// Serves a controller in Python to the run that started this process. @param make  "MODULE:CLASS" -> the parts of
/// PythonCode
int serve_controller(const py::function& make) {
  return interchange::run_host(
      [&make](const interchange::ForeignSetup& setup) -> std::unique_ptr<interchange::ForeignCode> {
        try {
          return std::make_unique<PythonCode>(py::tuple(make(setup.file.string())));
        } catch (py::error_already_set& error) {  // its own text would have a traceback through this program
          if (!error.matches(PyExc_ValueError)) throw;
          throw std::invalid_argument(py::str(error.value()));
        } catch (const std::invalid_argument& error) {
          throw std::invalid_argument("controller " + setup.file.string() + ": " + error.what());
        }
      },
      [] { return std::uint64_t{0}; });  // every step of Python allocates
}

}  // namespace

PYBIND11_MODULE(_network, module) {
  module.doc() = "What the package abs_hil needs for a network. Use the package abs_hil.";
  py::register_local_exception_translator(&translate);
  py::class_<Subscription>(module, "Subscription")
      .def(py::init<const std::string&, const std::string&>(), py::arg("url"), py::arg("channels"))
      .def("next", &Subscription::next, py::arg("timeout_s"))
      .def("waiting", &Subscription::waiting)
      .def_property_readonly("url", &Subscription::url);
  module.def("send_command", &send_command, py::arg("command"), py::arg("name"), py::arg("value"), py::arg("url"),
             py::arg("prefix"), py::arg("key_file"), py::arg("timeout_s"));
  module.def(
      "check_key", [](const std::string& file) { static_cast<void>(commands::read_key(file)); }, py::arg("file"));
  module.def("controller_files", &controller_files, py::arg("program"));
  module.def("serve_controller", &serve_controller, py::arg("make"));
}
