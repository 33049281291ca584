// Messages of a running rig.

#include <poll.h>

#include <algorithm>
#include <deque>
#include <string>
#include <utility>

#include "bindings.hpp"
#include "telemetry/receiver.hpp"

namespace abs_hil::python {

namespace {

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
  [[nodiscard]] const std::string& url() const { return receiver_.url(); }

 private:
  std::deque<std::pair<std::string, std::string>> received_;
  telemetry::Receiver receiver_;
};

}  // namespace

void add_network(py::module_& module) {
  py::class_<Subscription>(module, "Subscription")
      .def(py::init<const std::string&, const std::string&>(), py::arg("url"), py::arg("channels"))
      .def("next", &Subscription::next, py::arg("timeout_s"))
      .def_property_readonly("url", &Subscription::url);
}

}  // namespace abs_hil::python
