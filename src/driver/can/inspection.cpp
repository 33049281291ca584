// What `abs_hil doctor` says of CAN interfaces: state, bit rate, and the load of a run on the bus.

#include <linux/can.h>
#include <sys/socket.h>
#include <unistd.h>

#include "driver/can/bus.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::can {
namespace {

using rig::formatted;

constexpr double megabit = 1e6;
constexpr double fd_data_rate = 5e6;
/// Above this load the bus has no reserve for other messages or for repeated ones after errors.
constexpr double most_load = 0.8;

std::string described(const InterfaceFacts& can) {
  std::string text = can.up ? "up" : "down";
  if (!can.state.empty()) text += ", " + can.state;
  if (can.bit_rate > 0) text += formatted(", %u bit/s", can.bit_rate);
  if (can.can_fd) text += can.data_bit_rate > 0 ? formatted(", CAN FD %u bit/s", can.data_bit_rate) : ", CAN FD";
  if (can.transmit_errors + can.receive_errors > 0) {
    text += formatted(", error counters %u (sending) and %u (receiving)", can.transmit_errors, can.receive_errors);
  }
  if (can.kind == "vcan") text += ", virtual: without a real bus";
  return text;
}

Finding judge_interface(const InterfaceFacts& can, double rate_Hz) {
  Finding f{.what = "CAN interface " + can.name, .detail = described(can)};
  if (const auto problem = problem_of(can)) {
    f.standing = Finding::Standing::warning;
    f.fix = problem->fix;
    return f;
  }
  if (can.bit_rate == 0) return f;
  const bool fd = can.can_fd && can.data_bit_rate > 0;
  const BusLoad load = bus_load(rate_Hz, can.bit_rate, can.data_bit_rate, fd);
  f.detail += formatted("; load at most %.1f %% at %g Hz", 100.0 * load.share, rate_Hz);
  if (load.share > most_load) {
    f.standing = Finding::Standing::warning;
    f.fix = formatted(
        "a higher bit rate (sudo ip link set %s down && sudo ip link set %s up type can bitrate "
        "1000000), CAN FD, or a lower --rate",
        can.name.c_str(), can.name.c_str());
  }
  return f;
}

/// Whether this kernel has CAN sockets.
bool has_can_sockets() noexcept {
  const FileDescriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  return socket.get() >= 0;
}

Finding bus_load_finding(double rate_Hz) {
  const auto classic = bus_load(rate_Hz, megabit, 0.0, false);
  const auto fd = bus_load(rate_Hz, megabit, fd_data_rate, true);
  return {.what = formatted("bus load of driver.kind=can at %g Hz", rate_Hz),
          .standing = Finding::Standing::note,
          .detail = formatted("at most %.1f %% of 1 Mbit/s; with CAN FD at 1 and 5 Mbit/s %.1f %%",
                              100.0 * classic.share, 100.0 * fd.share)};
}

}  // namespace

std::vector<Finding> judge(const std::vector<InterfaceFacts>& interfaces, bool can_sockets, double rate_Hz) {
  std::vector<Finding> findings;
  if (interfaces.empty()) {
    findings.push_back({.what = "no CAN interface",
                        .standing = Finding::Standing::note,
                        .detail = can_sockets ? "" : "this kernel has no CAN sockets (sudo modprobe can_raw)"});
  }
  for (const InterfaceFacts& can : interfaces) findings.push_back(judge_interface(can, rate_Hz));
  findings.push_back(bus_load_finding(rate_Hz));
  return findings;
}

std::vector<Finding> inspect(const CanOptions& /*options*/, double rate_Hz, bool /*chosen*/) {
  try {
    return judge(can_interfaces(), has_can_sockets(), rate_Hz);
  } catch (const Unavailable& error) {
    return {{.what = "CAN interfaces", .standing = Finding::Standing::note, .detail = error.what()}};
  }
}

}  // namespace abs_hil::driver::can
