// Opens the CAN socket, sends and receives frames, and tells bus states from error frames.
#include "driver/can/bus.hpp"

#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <thread>
#include <utility>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "driver/board_kit.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::can {

namespace {

std::int64_t ns_of(const timespec& time) noexcept { return std::int64_t{time.tv_sec} * rig::ns_per_s + time.tv_nsec; }

IoResult failure(std::uint32_t where, int error) noexcept {
  // A missing interface gives ENODEV or ENXIO. A closed peer of a socket pair gives EPIPE or ECONNRESET.
  const bool down = error == ENETDOWN || error == ENODEV || error == ENXIO || error == EPIPE || error == ECONNRESET ||
                    error == ENOTCONN || error == ECONNREFUSED;
  return {IoError::disconnected, where, error, down ? rig::Reason::can_interface_down : rig::Reason::none};
}

/// The kernel stamps with the settable clock (CLOCK_REALTIME). The age of a frame is the same on both clocks.
std::int64_t monotonic_of(const timespec& realtime) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const std::int64_t age_ns = std::max<std::int64_t>(0, ns_of(now) - ns_of(realtime));
  return monotonic_ns() -
         std::min(age_ns, rig::ns_per_s);  // at most 1 s: setting the clock must not make a frame years old
}

void unpack(const canfd_frame& raw, std::size_t size, Frame& frame) noexcept {
  frame = {};
  frame.fd = size == CANFD_MTU;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  // Extended and remote frames keep their flags, so that they match no identifier.
  frame.id = frame.error ? raw.can_id & CAN_ERR_MASK : raw.can_id;
  frame.length = std::min<std::uint8_t>(raw.len, frame.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
  std::memcpy(frame.data.data(), raw.data, frame.length);
}

}  // namespace

FrameSocket::FrameSocket(FileDescriptor descriptor) noexcept : descriptor_(std::move(descriptor)) {
  ::fcntl(descriptor_.get(), F_SETFL, ::fcntl(descriptor_.get(), F_GETFL) | O_NONBLOCK);
  const int on = 1;
  // These options may fail. Without them a frame counts as received when it is read, and drops show as losses.
  ::setsockopt(descriptor_.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  ::setsockopt(descriptor_.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
}

IoResult FrameSocket::send(const Frame& frame) noexcept {
  canfd_frame raw{};
  raw.can_id = frame.id;
  raw.len = frame.length;
  if (frame.fd) raw.flags = CANFD_BRS;
  std::memcpy(raw.data, frame.data.data(), std::min<std::size_t>(frame.length, sizeof raw.data));
  const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
  if (::send(descriptor_.get(), &raw, size, MSG_DONTWAIT | MSG_NOSIGNAL) == static_cast<ssize_t>(size)) return {};
  const bool full = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS;
  return full ? IoResult{IoError::no_answer, frame.id, errno} : failure(frame.id, errno);
}

IoResult FrameSocket::take(Frame& frame) noexcept {
  canfd_frame raw{};
  iovec part{&raw, sizeof raw};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))];
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t size = ::recvmsg(descriptor_.get(), &message, MSG_DONTWAIT);
  if (size < 0) {
    const bool none = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    return none ? IoResult{IoError::no_answer} : failure(id::latch, errno);
  }
  if (size == 0) return failure(id::latch, EPIPE);  // the peer has closed; a CAN socket never returns 0
  const bool whole = (message.msg_flags & MSG_TRUNC) == 0;
  if (!whole || (size != CAN_MTU && size != CANFD_MTU)) return {IoError::incomplete_answer};
  unpack(raw, static_cast<std::size_t>(size), frame);
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
      frame.received_ns = monotonic_of(stamp);
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&dropped_, CMSG_DATA(c), sizeof dropped_);
    }
  }
  if (frame.received_ns == 0) frame.received_ns = monotonic_ns();
  return {};
}

IoResult FrameSocket::receive(Frame& frame, std::int64_t deadline_ns) noexcept {
  for (;;) {
    const IoResult result = take(frame);
    if (result.error != IoError::no_answer) return result;
    const std::int64_t left_ns = deadline_ns - monotonic_ns();
    if (left_ns <= 0) return result;
    pollfd waiting{descriptor_.get(), POLLIN, 0};
    const timespec limit{static_cast<time_t>(left_ns / rig::ns_per_s), static_cast<long>(left_ns % rig::ns_per_s)};
    static_cast<void>(::ppoll(&waiting, 1, &limit, nullptr));
  }
}

bool FrameSocket::ask_interface(ifreq& request) const noexcept {
  return ::ioctl(descriptor_.get(), SIOCGIFFLAGS, &request) == 0;
}

void FrameSocket::drain() noexcept {
  constexpr int most_frames = 10'000;
  Frame ignored;
  for (int i = 0; i < most_frames; ++i) {
    const IoError error = take(ignored).error;
    if (error != IoError::none && error != IoError::incomplete_answer) return;
  }
}

BusReport bus_report(const Frame& error_frame) noexcept {
  const std::uint32_t kind = error_frame.id;
  const unsigned controller = (kind & CAN_ERR_CRTL) != 0 ? error_frame.data[1] : 0U;
  return {.bus_off = (kind & CAN_ERR_BUSOFF) != 0,
          .error_passive = (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0,
          .error_warning = (controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0,
          .receive_overflow = (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0};
}

namespace {

[[noreturn]] void refuse_with_cause(const std::string& what) {
  refuse(what + ": " + rig::refusal(errno, "can_raw", rig::reaching));
}

void set_option(const FileDescriptor& socket, int name, const void* value, std::size_t size, const char* what) {
  if (::setsockopt(socket.get(), SOL_CAN_RAW, name, value, static_cast<socklen_t>(size)) == 0) return;
  refuse_with_cause(std::string("CAN socket: ") + what);
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

FileDescriptor open_raw_socket(const InterfaceFacts& facts, bool fd_frames) {
  FileDescriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (socket.get() < 0) {
    refuse_with_cause("cannot open a CAN socket");
  }
  const std::vector<can_filter> filters = node_filters();
  set_option(socket, CAN_RAW_FILTER, filters.data(), filters.size() * sizeof(can_filter), "filters");
  const can_err_mask_t all_errors = CAN_ERR_MASK;
  set_option(socket, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors, "error frames");
  const int on = 1;
  if (fd_frames) set_option(socket, CAN_RAW_FD_FRAMES, &on, sizeof on, "CAN FD frames");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(facts.name.c_str()));
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    refuse_with_cause("CAN interface " + facts.name + ": cannot be opened");
  }
  return socket;
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
  FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (socket.get() < 0) refuse_with_cause("cannot open an AF_UNIX socket");
  // How long to wait for a peer whose queue of connections is full; 0 would be for ever.
  const timeval limit{.tv_sec = wait ? 2 : 0, .tv_usec = wait ? 0 : 1};
  ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    refuse_with_cause("socket " + path + " (driver.can.interface; start abs_rig_emulator --can unix:" + path + ")");
  }
  return {.socket = std::make_unique<FrameSocket>(std::move(socket)), .place = "socket " + path, .can_fd = true};
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
