#include "bus_socket.hpp"

#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace abs_hil::program {

namespace {

[[noreturn]] void refuse(const std::string& what) { throw std::runtime_error("--can " + what + std::strerror(errno)); }

/// Removes the socket that a killed emulator has left behind. Any other file is somebody's.
void remove_old_socket(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) {
    throw std::invalid_argument("--can unix:" + path + ": this file exists and is no socket; give another path");
  }
  ::unlink(path.c_str());
}

}  // namespace

BusSocket::BusSocket(const std::string& interface) {
  if (interface.starts_with("unix:")) {
    listen_at(interface.substr(5));
  } else {
    open_can(interface);
  }
}

BusSocket::~BusSocket() {
  if (client_ >= 0) ::close(client_);
  if (listening_ >= 0) ::close(listening_);
  if (!path_.empty()) ::unlink(path_.c_str());
}

void BusSocket::open_can(const std::string& interface) {
  client_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (client_ < 0) refuse(interface + ": no CAN socket (sudo modprobe can_raw): ");
  // ABS_TIME, ABS_SYNC, ABS_COMMAND, ABS_CONTROL.
  constexpr canid_t exactly = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
  const can_filter filters[] = {{0x7F, exactly}, {0x80, exactly}, {0x81, exactly}, {0x82, exactly}};
  const int on = 1;
  if (::setsockopt(client_, SOL_CAN_RAW, CAN_RAW_FILTER, filters, sizeof filters) != 0 ||
      ::setsockopt(client_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0) {
    refuse(interface + ": ");
  }
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  can_fd_ = ::ioctl(client_, SIOCGIFMTU, &request) == 0 && request.ifr_mtu >= static_cast<int>(CANFD_MTU);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) refuse(interface + ": ");
  if (::bind(client_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) refuse(interface + ": ");
}

void BusSocket::listen_at(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    throw std::invalid_argument("--can unix:" + path + ": give a path of 1 to 107 characters");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  listening_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  remove_old_socket(path);
  if (listening_ < 0 || ::bind(listening_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listening_, 1) != 0) {
    refuse("unix:" + path + ": ");
  }
  path_ = path;
}

bool BusSocket::receive(emulator::BusFrame& frame) {
  if (client_ < 0) client_ = ::accept4(listening_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (client_ < 0) return false;
  canfd_frame raw{};
  const ssize_t size = ::recv(client_, &raw, sizeof raw, MSG_DONTWAIT);
  if (size == 0 && listening_ >= 0) {
    ::close(client_);
    client_ = -1;
  }
  // An interface that goes down returns one error. The node then continues and receives nothing.
  if (size != CAN_MTU && size != CANFD_MTU) return false;
  frame = {.id = raw.can_id, .length = std::min<std::uint8_t>(raw.len, CANFD_MAX_DLEN), .fd = size == CANFD_MTU};
  std::memcpy(frame.data.data(), raw.data, frame.length);
  return true;
}

void BusSocket::send(const emulator::BusFrame& frame) {
  canfd_frame raw{};
  raw.can_id = frame.id;
  raw.len = frame.length;
  if (frame.fd) raw.flags = CANFD_BRS;
  std::memcpy(raw.data, frame.data.data(), frame.length);
  static_cast<void>(::send(client_, &raw, frame.fd ? CANFD_MTU : CAN_MTU, MSG_DONTWAIT | MSG_NOSIGNAL));
}

}  // namespace abs_hil::program
