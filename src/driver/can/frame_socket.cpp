#include "driver/can/frame_socket.hpp"

#include <fcntl.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::can {

namespace {

std::int64_t ns_of(const timespec& time) noexcept { return std::int64_t{time.tv_sec} * rig::ns_per_s + time.tv_nsec; }

bool is_full(int error) noexcept { return error == EAGAIN || error == EWOULDBLOCK || error == ENOBUFS; }

bool is_down(int error) noexcept {
  // A missing interface gives ENODEV or ENXIO. A closed peer of a socket pair gives EPIPE or ECONNRESET.
  return error == ENETDOWN || error == ENODEV || error == ENXIO || error == EPIPE || error == ECONNRESET ||
         error == ENOTCONN || error == ECONNREFUSED;
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

FrameSocket::FrameSocket(int descriptor) noexcept : descriptor_(descriptor) {
  ::fcntl(descriptor_, F_SETFL, ::fcntl(descriptor_, F_GETFL) | O_NONBLOCK);
  const int on = 1;
  // These options may fail. Without them a frame counts as received when it is read, and drops show as losses.
  ::setsockopt(descriptor_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  ::setsockopt(descriptor_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
}

FrameSocket::~FrameSocket() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

SendResult FrameSocket::send(const Frame& frame) noexcept {
  canfd_frame raw{};
  raw.can_id = frame.id;
  raw.len = frame.length;
  if (frame.fd) raw.flags = CANFD_BRS;
  std::memcpy(raw.data, frame.data.data(), std::min<std::size_t>(frame.length, sizeof raw.data));
  const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
  if (::send(descriptor_, &raw, size, MSG_DONTWAIT | MSG_NOSIGNAL) == static_cast<ssize_t>(size)) return {};
  if (is_full(errno)) return {SendOutcome::full, errno};
  return {is_down(errno) ? SendOutcome::down : SendOutcome::failed, errno};
}

ReceiveResult FrameSocket::take(Frame& frame) noexcept {
  canfd_frame raw{};
  iovec part{&raw, sizeof raw};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))];
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  const ssize_t size = ::recvmsg(descriptor_, &message, MSG_DONTWAIT);
  if (size < 0) {
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) return {};
    return {is_down(errno) ? ReceiveOutcome::down : ReceiveOutcome::failed, errno};
  }
  if (size == 0) return {ReceiveOutcome::down, EPIPE};  // the peer has closed; a CAN socket never returns 0
  const bool whole = (message.msg_flags & MSG_TRUNC) == 0;
  if (!whole || (size != CAN_MTU && size != CANFD_MTU)) return {ReceiveOutcome::malformed};
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
  return {ReceiveOutcome::frame};
}

ReceiveResult FrameSocket::receive(Frame& frame, std::int64_t deadline_ns) noexcept {
  for (;;) {
    const ReceiveResult result = take(frame);
    if (result.outcome != ReceiveOutcome::nothing) return result;
    const std::int64_t left_ns = deadline_ns - monotonic_ns();
    if (left_ns <= 0) return result;
    pollfd waiting{descriptor_, POLLIN, 0};
    const timespec limit{static_cast<time_t>(left_ns / rig::ns_per_s), static_cast<long>(left_ns % rig::ns_per_s)};
    static_cast<void>(::ppoll(&waiting, 1, &limit, nullptr));
  }
}

bool FrameSocket::ask_interface(ifreq& request) const noexcept {
  return ::ioctl(descriptor_, SIOCGIFFLAGS, &request) == 0;
}

void FrameSocket::drain() noexcept {
  constexpr int most_frames = 10'000;
  Frame ignored;
  for (int i = 0; i < most_frames; ++i) {
    const ReceiveOutcome outcome = take(ignored).outcome;
    if (outcome != ReceiveOutcome::frame && outcome != ReceiveOutcome::malformed) return;
  }
}

}  // namespace abs_hil::driver::can
