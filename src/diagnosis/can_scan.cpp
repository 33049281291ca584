// Looks at the CAN interfaces for `abs_hil doctor`.
#include <fmt/format.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <unistd.h>

#include "diagnosis/doctor.hpp"
#include "driver/can/protocol.hpp"

namespace abs_hil::diagnosis {

namespace {

using driver::can::InterfaceFacts;

constexpr double megabit = 1e6;
constexpr double fd_data_rate = 5e6;
/// Above this load the bus has no reserve for other messages or for repeated ones after errors.
constexpr double most_load = 0.8;

std::string described(const InterfaceFacts& can) {
  std::string text = can.up ? "up" : "down";
  if (!can.state.empty()) text += ", " + can.state;
  if (can.bit_rate > 0) text += fmt::format(", {} bit/s", can.bit_rate);
  if (can.can_fd) text += can.data_bit_rate > 0 ? fmt::format(", CAN FD {} bit/s", can.data_bit_rate) : ", CAN FD";
  if (can.transmit_errors + can.receive_errors > 0) {
    text += fmt::format(", error counters {} (sending) and {} (receiving)", can.transmit_errors, can.receive_errors);
  }
  if (can.kind == "vcan") text += ", virtual: without a real bus";
  return text;
}

Finding judge_interface(const InterfaceFacts& can, double rate_Hz) {
  Finding f{.check = "can", .what = "CAN interface " + can.name, .detail = described(can)};
  if (const auto problem = driver::can::problem_of(can)) {
    f.standing = Standing::warning;
    f.fix = problem->fix;
    return f;
  }
  if (can.bit_rate == 0) return f;
  const bool fd = can.can_fd && can.data_bit_rate > 0;
  const driver::can::BusLoad load = driver::can::bus_load(rate_Hz, can.bit_rate, can.data_bit_rate, fd);
  f.detail += fmt::format("; load at most {:.1f} % at {:g} Hz", 100.0 * load.share, rate_Hz);
  if (load.share > most_load) {
    f.standing = Standing::warning;
    f.fix = fmt::format(
        "a higher bit rate (sudo ip link set {0} down && sudo ip link set {0} up type can bitrate "
        "1000000), CAN FD, or a lower --rate",
        can.name);
  }
  return f;
}

}  // namespace

bool has_can_sockets() noexcept {
  const int socket = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (socket >= 0) ::close(socket);
  return socket >= 0;
}

Finding bus_load_finding(double rate_Hz) {
  const auto classic = driver::can::bus_load(rate_Hz, megabit, 0.0, false);
  const auto fd = driver::can::bus_load(rate_Hz, megabit, fd_data_rate, true);
  return {.check = "can",
          .what = fmt::format("bus load of driver.kind=can at {:g} Hz", rate_Hz),
          .standing = Standing::note,
          .detail = fmt::format("at most {:.1f} % of 1 Mbit/s; with CAN FD at 1 and 5 Mbit/s {:.1f} %",
                                100.0 * classic.share, 100.0 * fd.share)};
}

std::vector<Finding> judge(const std::vector<InterfaceFacts>& interfaces, bool can_sockets, double rate_Hz) {
  std::vector<Finding> findings;
  if (interfaces.empty()) {
    findings.push_back({.check = "can",
                        .what = "no CAN interface",
                        .standing = Standing::note,
                        .detail = can_sockets ? "" : "this kernel has no CAN sockets (sudo modprobe can_raw)"});
  }
  for (const InterfaceFacts& can : interfaces) findings.push_back(judge_interface(can, rate_Hz));
  findings.push_back(bus_load_finding(rate_Hz));
  return findings;
}

}  // namespace abs_hil::diagnosis
