// CAN interfaces and the network to an hm2 board, as `abs_hil doctor` sees them.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <linux/can.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>

#include "diagnosis/doctor.hpp"
#include "driver/can/protocol.hpp"
#include "driver/file_descriptor.hpp"
#include "driver/monotonic_time.hpp"

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

using driver::FileDescriptor;

std::string text_of(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  return ::inet_ntop(AF_INET, &address, text.data(), text.size()) == nullptr ? "" : text.data();
}

/// The interface that datagrams to the board leave through; empty: none.
std::string interface_to(const sockaddr_in& board, int socket) {
  sockaddr_in own{};
  socklen_t size = sizeof own;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&board), sizeof board) != 0 ||
      ::getsockname(socket, reinterpret_cast<sockaddr*>(&own), &size) != 0) {
    return {};
  }
  ifaddrs* raw = nullptr;
  if (::getifaddrs(&raw) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all(raw, ::freeifaddrs);
  for (const ifaddrs* one = all.get(); one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, one->ifa_addr, sizeof address);
    if (address.sin_addr.s_addr == own.sin_addr.s_addr) return one->ifa_name;
  }
  return {};
}

Finding judge_coalescing(const std::string& interface, int socket) {
  Finding f{.check = "hm2", .what = "interrupt coalescing of " + interface, .standing = Standing::note};
  ethtool_coalesce coalescing{};
  coalescing.cmd = ETHTOOL_GCOALESCE;
  ifreq request{};
  interface.copy(static_cast<char*>(request.ifr_name), IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&coalescing);
  if (::ioctl(socket, SIOCETHTOOL, &request) != 0) {
    f.detail = "this interface has none to set";
    return f;
  }
  f.detail = fmt::format("rx-usecs {}", coalescing.rx_coalesce_usecs);
  f.standing = coalescing.rx_coalesce_usecs == 0 ? Standing::good : Standing::warning;
  if (f.standing == Standing::warning) f.fix = "sudo ethtool -C " + interface + " rx-usecs 0";
  return f;
}

/// Requests of one small read each. Datagrams of others show in the board's count of datagrams, or of all packets where
/// it does not count datagrams apart.
Finding measure_round_trips(const sockaddr_in& board) {
  constexpr int asked = 500;
  constexpr std::int64_t wait_ns = 5'000'000;
  driver::hm2::UdpLink link(board);
  driver::hm2::Packet packet;
  packet.read(driver::hm2::space::status, driver::hm2::at::received, 2);
  std::array<std::uint8_t, 4> answer{};
  std::uint32_t number = static_cast<std::uint32_t>(driver::monotonic_ns());
  std::vector<double> times_us;
  int foreign = 0;
  int silent = 0;
  driver::hm2::Received received;
  for (int i = 0; i < asked && silent < 10; ++i) {
    const std::int64_t sent_ns = driver::monotonic_ns();
    if (!driver::hm2::ask(link, packet, answer, number, wait_ns, 1)) {
      ++silent;
      continue;
    }
    times_us.push_back(1e-3 * static_cast<double>(driver::monotonic_ns() - sent_ns));
    const driver::hm2::Received now{.all = driver::hm2::word16(answer, 0), .udp = driver::hm2::word16(answer, 2)};
    if (times_us.size() > 1) {
      const auto came =
          static_cast<std::uint16_t>(now.udp != received.udp ? now.udp - received.udp : now.all - received.all);
      foreign += std::max(came - 1 - silent, 0);
    }
    received = now;
    silent = 0;
  }
  return judge_round_trips(std::move(times_us), asked, foreign);
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

Finding judge_round_trips(std::vector<double> times_us, int asked, int foreign) {
  Finding f{.check = "hm2", .what = "round trips to the board"};
  if (times_us.empty()) {
    f.standing = Standing::failure;
    f.detail = "no answer";
    f.fix = "check the board's power, the cable, and the address of this computer's interface (docs/hm2.md)";
    return f;
  }
  std::ranges::sort(times_us);
  const auto part = [&](double share) {
    return times_us[static_cast<std::size_t>(share * static_cast<double>(times_us.size() - 1))];
  };
  const auto lost = asked - static_cast<int>(times_us.size());
  f.detail = fmt::format("{} of {} answered; least {:.0f}, half {:.0f}, 90 % {:.0f}, 99 % {:.0f}, most {:.0f} us",
                         times_us.size(), asked, times_us.front(), part(0.5), part(0.9), part(0.99), times_us.back());
  constexpr double longest_us = 800.0;  // 80 % of a period of 1 ms
  if (lost > 0 || times_us.back() > longest_us) {
    f.standing = Standing::warning;
    f.fix = "own interface, static ARP, coalescing off, --rt require (docs/hm2.md, \"The network\")";
  }
  if (foreign > 0) {
    f.standing = Standing::warning;
    f.detail += fmt::format("; {} packets came from others", foreign);
    f.fix =
        "end the other program, or keep the interface for the board alone (docs/hm2.md, \"The network\"); a "
        "guardian that keeps this board looks at it and counts here, too";
  }
  return f;
}

Finding judge_arp(const std::string& table, const std::string& address, const std::string& interface) {
  Finding f{.check = "hm2", .what = "ARP entry of " + address, .standing = Standing::warning, .detail = "none"};
  std::string mac = "MAC";
  std::istringstream lines(table);
  for (std::string line, ip, type, flags, found; std::getline(lines, line);) {
    std::istringstream(line) >> ip >> type >> flags >> found;
    if (ip != address) continue;
    constexpr unsigned long permanent = 0x4;
    if ((std::strtoul(flags.c_str(), nullptr, 16) & permanent) != 0) {
      return {.check = f.check, .what = f.what, .detail = found + ", permanent"};
    }
    mac = found;
    f.detail =
        mac + ", not permanent: the kernel asks again from time to time, and a cycle then waits for that answer, too";
    break;
  }
  f.fix = fmt::format("sudo ip neigh replace {} lladdr {} nud permanent dev {}", address, mac, interface);
  return f;
}

std::vector<Finding> scan_hm2(const driver::hm2::Hm2Options& options) {
  const sockaddr_in board = driver::hm2::parse_address(options.address);
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const std::string interface = interface_to(board, socket.get());
  Finding where{.check = "hm2", .what = "interface to " + options.address, .detail = interface};
  if (interface.empty()) {
    where.standing = Standing::failure;
    where.detail = "no route";
    where.fix = "give an interface an address in the board's network: sudo ip addr add 192.168.1.1/24 dev IFACE";
    return {where};
  }
  std::vector<Finding> findings{where};
  if (interface != "lo") {
    std::ifstream arp("/proc/net/arp");
    const std::string table{std::istreambuf_iterator<char>(arp), {}};
    findings.push_back(judge_arp(table, text_of(board.sin_addr), interface));
    findings.push_back(judge_coalescing(interface, socket.get()));
  }
  findings.push_back(measure_round_trips(board));
  return findings;
}

}  // namespace abs_hil::diagnosis
