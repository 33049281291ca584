// What `abs_hil doctor` says of the network to an hm2 board: the interface that leads there, its ARP entry and
// coalescing, round trips, and whether somebody else talks to the board. It only reads.
#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <sstream>

#include "driver/file_descriptor.hpp"
#include "driver/hm2/hm2_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {
namespace {

using rig::formatted;

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
  Finding f{.what = "interrupt coalescing of " + interface, .standing = Finding::Standing::note};
  ethtool_coalesce coalescing{};
  coalescing.cmd = ETHTOOL_GCOALESCE;
  ifreq request{};
  interface.copy(static_cast<char*>(request.ifr_name), IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&coalescing);
  if (::ioctl(socket, SIOCETHTOOL, &request) != 0) {
    f.detail = "this interface has none to set";
    return f;
  }
  f.detail = formatted("rx-usecs %u", coalescing.rx_coalesce_usecs);
  f.standing = coalescing.rx_coalesce_usecs == 0 ? Finding::Standing::good : Finding::Standing::warning;
  if (f.standing == Finding::Standing::warning) f.fix = "sudo ethtool -C " + interface + " rx-usecs 0";
  return f;
}

/// Requests of one small read each. Datagrams of others show in the board's count of datagrams, or of all packets where
/// it does not count datagrams apart.
Finding measure_round_trips(const sockaddr_in& board) {
  constexpr int asked = 500;
  constexpr std::int64_t wait_ns = 5'000'000;
  UdpLink link(board);
  Packet packet;
  packet.read(space::status, at::received, 2);
  std::array<std::uint8_t, 4> answer{};
  std::uint32_t number = static_cast<std::uint32_t>(monotonic_ns());
  std::vector<double> times_us;
  int foreign = 0;
  int silent = 0;
  Received received;
  for (int i = 0; i < asked && silent < 10; ++i) {
    const std::int64_t sent_ns = monotonic_ns();
    if (!ask(link, packet, answer, number, wait_ns, 1)) {
      ++silent;
      continue;
    }
    times_us.push_back(1e-3 * static_cast<double>(monotonic_ns() - sent_ns));
    const Received now{.all = word16(answer, 0), .udp = word16(answer, 2)};
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

Finding judge_round_trips(std::vector<double> times_us, int asked, int foreign) {
  Finding f{.what = "round trips to the board"};
  if (times_us.empty()) {
    f.standing = Finding::Standing::failure;
    f.detail = "no answer";
    f.fix = "check the board's power, the cable, and the address of this computer's interface (docs/hm2.md)";
    return f;
  }
  std::ranges::sort(times_us);
  const auto part = [&](double share) {
    return times_us[static_cast<std::size_t>(share * static_cast<double>(times_us.size() - 1))];
  };
  const auto lost = asked - static_cast<int>(times_us.size());
  f.detail = formatted("%zu of %d answered; least %.0f, half %.0f, 90 %% %.0f, 99 %% %.0f, most %.0f us",
                       times_us.size(), asked, times_us.front(), part(0.5), part(0.9), part(0.99), times_us.back());
  constexpr double longest_us = 800.0;  // 80 % of a period of 1 ms
  if (lost > 0 || times_us.back() > longest_us) {
    f.standing = Finding::Standing::warning;
    f.fix = "own interface, static ARP, coalescing off, --rt require (docs/hm2.md, \"The network\")";
  }
  if (foreign > 0) {
    f.standing = Finding::Standing::warning;
    f.detail += formatted("; %d packets came from others", foreign);
    f.fix =
        "end the other program, or keep the interface for the board alone (docs/hm2.md, \"The network\"); a "
        "guardian that keeps this board looks at it and counts here, too";
  }
  return f;
}

Finding judge_arp(const std::string& table, const std::string& address, const std::string& interface) {
  Finding f{.what = "ARP entry of " + address, .standing = Finding::Standing::warning, .detail = "none"};
  std::string mac = "MAC";
  std::istringstream lines(table);
  for (std::string line, ip, type, flags, found; std::getline(lines, line);) {
    std::istringstream(line) >> ip >> type >> flags >> found;
    if (ip != address) continue;
    constexpr unsigned long permanent = 0x4;
    if ((std::strtoul(flags.c_str(), nullptr, 16) & permanent) != 0) {
      return {.what = f.what, .detail = found + ", permanent"};
    }
    mac = found;
    f.detail =
        mac + ", not permanent: the kernel asks again from time to time, and a cycle then waits for that answer, too";
    break;
  }
  f.fix = "sudo ip neigh replace " + address + " lladdr " + mac + " nud permanent dev " + interface;
  return f;
}

std::vector<Finding> inspect(const Hm2Options& options, double /*rate_Hz*/, bool chosen) {
  // It sends datagrams, so only to a board that is named.
  if (!chosen) return {{.what = "no hm2 board is configured (driver.kind)", .standing = Finding::Standing::note}};
  const sockaddr_in board = parse_address(options.address);
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const std::string interface = interface_to(board, socket.get());
  Finding where{.what = "interface to " + options.address, .detail = interface};
  if (interface.empty()) {
    where.standing = Finding::Standing::failure;
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

}  // namespace abs_hil::driver::hm2
