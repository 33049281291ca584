#include "driver/can/link.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/can/protocol.hpp"

namespace abs_hil::driver::can {

namespace {

std::string system_words(int error) { return std::strerror(error); }

void set_option(int descriptor, int name, const void* value, socklen_t size, const char* what) {
  if (::setsockopt(descriptor, SOL_CAN_RAW, name, value, size) != 0) {
    const int error = errno;
    ::close(descriptor);
    refuse(std::string("CAN socket: ") + what + ": " + system_words(error));
  }
}

/// Receives only the node's identifiers, and those with which another sender would command the node. The kernel drops
/// all other frames, so that a busy bus costs nothing here.
std::vector<can_filter> node_filters() {
  std::vector<can_filter> filters;
  for (const Message& message : messages()) {
    const bool commands = message.id == id::command || message.id == id::control;
    if (message.from_node || commands) filters.push_back({message.id, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  return filters;
}

int open_raw_socket(const InterfaceFacts& facts, bool fd_frames) {
  const int descriptor = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (descriptor < 0) {
    refuse("cannot open a CAN socket: " + system_words(errno) + "; load the kernel module: sudo modprobe can_raw");
  }
  const std::vector<can_filter> filters = node_filters();
  set_option(descriptor, CAN_RAW_FILTER, filters.data(), static_cast<socklen_t>(filters.size() * sizeof(can_filter)),
             "filters");
  const can_err_mask_t all_errors = CAN_ERR_MASK;
  set_option(descriptor, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors, "error frames");
  const int on = 1;
  if (fd_frames) set_option(descriptor, CAN_RAW_FD_FRAMES, &on, sizeof on, "CAN FD frames");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(facts.name.c_str()));
  if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    ::close(descriptor);
    refuse("CAN interface " + facts.name + ": cannot be opened: " + system_words(error));
  }
  return descriptor;
}

/// Waits for the carrier of an interface that was just set up (the kernel's linkwatch takes up to 1 s).
std::optional<InterfaceFacts> find_settled_interface(const std::string& name, bool wait) {
  const int attempts = wait ? 40 : 0;
  constexpr std::chrono::milliseconds pause{50};
  std::optional<InterfaceFacts> facts = find_interface(name);
  for (int i = 0; i < attempts && facts && facts->up && !facts->running && facts->state != "bus-off"; ++i) {
    std::this_thread::sleep_for(pause);
    facts = find_interface(name);
  }
  return facts;
}

Link open_interface(const CanOptions& options, bool wait) {
  const std::optional<InterfaceFacts> facts = find_settled_interface(options.interface, wait);
  if (!facts) {
    std::string known;
    for (const InterfaceFacts& other : can_interfaces()) known += (known.empty() ? "" : ", ") + other.name;
    refuse("no CAN interface " + options.interface + " (driver.can.interface); there " +
           (known.empty() ? "is none: plug the adapter in and load its kernel module (docs/can.md)" : "are " + known));
  }
  if (const auto problem = problem_of(*facts)) {
    refuse("CAN interface " + facts->name + " is " + problem->what + ": " + problem->fix);
  }
  if (options.fd == "on" && !facts->can_fd) {
    refuse("CAN interface " + facts->name + " takes no CAN FD frames (driver.can.fd=on): run sudo ip link set " +
           facts->name + " type can bitrate 1000000 dbitrate 5000000 fd on, or set driver.can.fd=auto");
  }
  return {.socket = std::make_unique<FrameSocket>(open_raw_socket(*facts, facts->can_fd)),
          .place = "CAN interface " + facts->name,
          .can_fd = facts->can_fd,
          .facts = facts};
}

Link open_unix_socket(const std::string& path, bool wait) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    refuse("driver.can.interface = unix:" + path + ": give a path of 1 to " +
           std::to_string(sizeof address.sun_path - 1) + " characters");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  const int descriptor = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (descriptor < 0) refuse("cannot open an AF_UNIX socket: " + system_words(errno));
  // How long to wait for a peer whose queue of connections is full; 0 would be for ever.
  const timeval limit{.tv_sec = wait ? 2 : 0, .tv_usec = wait ? 0 : 1};
  ::setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    ::close(descriptor);
    refuse("socket " + path + " (driver.can.interface): " + system_words(error) +
           "; start abs_rig_emulator --can unix:" + path);
  }
  return {.socket = std::make_unique<FrameSocket>(descriptor), .place = "socket " + path, .can_fd = true};
}

}  // namespace

bool Link::running() const noexcept {
  if (!facts) return true;
  ifreq request{};
  std::memcpy(request.ifr_name, facts->name.c_str(), std::min<std::size_t>(facts->name.size(), IFNAMSIZ - 1));
  if (!socket->ask_interface(request)) return false;
  const auto flags = static_cast<unsigned>(request.ifr_flags);
  // An interface that goes down loses its carrier first.
  return (flags & IFF_UP) != 0 && (flags & IFF_RUNNING) != 0;
}

Link open_link(const CanOptions& options, bool wait) {
  const std::string prefix(unix_prefix);
  return options.interface.starts_with(prefix) ? open_unix_socket(options.interface.substr(prefix.size()), wait)
                                               : open_interface(options, wait);
}

}  // namespace abs_hil::driver::can
