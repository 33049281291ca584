// Messages of a running rig.

#include <cerrno>
#include <cstring>
#include <deque>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <utility>

#include "bindings.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/lcm_url.hpp"

namespace abs_hil::python {

namespace {

/// Channels of an LCM network. Used by one thread.
class Subscription {
 public:
  Subscription(const std::string& url, const std::string& channels)
      : url_(url.empty() ? telemetry::default_lcm_url() : url) {
    static_cast<void>(telemetry::parse_lcm_url(url_));
    lcm_ = std::make_unique<lcm::LCM>(url_);
    if (!lcm_->good()) {
      throw telemetry::LcmError(url_ + ": LCM cannot use this network; `abs_hil doctor --only lcm` says why");
    }
    lcm::Subscription* all = lcm_->subscribe(channels, &Subscription::take, this);
    if (all == nullptr) throw std::invalid_argument("channels \"" + channels + "\": give a regular expression");
    constexpr int queued = 10'000;
    all->setQueueCapacity(queued);
  }
  /// (channel, bytes), or None after `timeout_s` without a message.
  py::object next(double timeout_s) {
    constexpr double ms_per_s = 1e3;
    constexpr double slice_ms = 100.0;
    double left_ms = timeout_s * ms_per_s;
    while (received_.empty() && left_ms > 0.0) {
      const int wait_ms = static_cast<int>(std::min(left_ms, slice_ms)) + 1;
      int handled = 0;
      {
        const py::gil_scoped_release release;
        handled = lcm_->handleTimeout(wait_ms);
      }
      if (handled < 0) throw telemetry::LcmError(url_ + ": LCM failed to receive");
      if (handled == 0) left_ms -= wait_ms;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    if (received_.empty()) return py::none();
    auto [channel, data] = std::move(received_.front());
    received_.pop_front();
    return py::make_tuple(channel, py::bytes(data));
  }

 private:
  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    received_.emplace_back(channel, std::string(static_cast<const char*>(buffer->data), buffer->data_size));
  }

  std::string url_;
  std::unique_ptr<lcm::LCM> lcm_;
  std::deque<std::pair<std::string, std::string>> received_;
};

}  // namespace

void add_network(py::module_& module) {
  py::class_<Subscription>(module, "Subscription")
      .def(py::init<const std::string&, const std::string&>(), py::arg("url"), py::arg("channels"))
      .def("next", &Subscription::next, py::arg("timeout_s"));
}

}  // namespace abs_hil::python
