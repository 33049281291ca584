#include "guardian/lease_wire.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace abs_hil::guardian {

namespace {

constexpr std::uint32_t lease_magic = 0x6C656132;  // a later protocol has another number
constexpr std::size_t longest_text = 60'000;
constexpr std::size_t most_files = 4;

struct LeaseHeader {
  std::uint32_t magic{lease_magic};
  std::uint32_t word{0};
  std::int32_t fifo_priority{0};
  std::uint8_t memory_locked{0};
  std::uint8_t safe{0};
  std::uint8_t unused[2]{};
};

union FileSpace {
  cmsghdr header;
  std::array<char, CMSG_SPACE(sizeof(int) * most_files)> bytes;
};

bool address_of(const std::string& path, sockaddr_un& address) {
  address = {};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    return false;
  }
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  return true;
}

int new_socket() { return ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0); }

int closed_with_errno(int fd) {
  const int error = errno;
  ::close(fd);
  errno = error;
  return -1;
}

}  // namespace

bool send_message(int socket, const LeaseMessage& message, std::initializer_list<int> files) {
  LeaseHeader header{.word = static_cast<std::uint32_t>(message.word),
                     .fifo_priority = message.scheduling.fifo_priority,
                     .memory_locked = static_cast<std::uint8_t>(message.scheduling.memory_locked),
                     .safe = static_cast<std::uint8_t>(message.safe)};
  std::string text = message.text.substr(0, longest_text);
  std::array<iovec, 2> parts{iovec{&header, sizeof header}, iovec{text.data(), text.size()}};
  msghdr packet{};
  packet.msg_iov = parts.data();
  packet.msg_iovlen = parts.size();
  FileSpace space{};
  if (files.size() > 0 && files.size() <= most_files) {
    packet.msg_control = space.bytes.data();
    packet.msg_controllen = CMSG_SPACE(sizeof(int) * files.size());
    cmsghdr* const control = CMSG_FIRSTHDR(&packet);
    control->cmsg_level = SOL_SOCKET;
    control->cmsg_type = SCM_RIGHTS;
    control->cmsg_len = CMSG_LEN(sizeof(int) * files.size());
    std::memcpy(CMSG_DATA(control), files.begin(), sizeof(int) * files.size());
  }
  const ssize_t sent = ::sendmsg(socket, &packet, MSG_NOSIGNAL | MSG_DONTWAIT);
  return sent == static_cast<ssize_t>(sizeof header + text.size());
}

std::optional<LeaseMessage> receive_message(int socket, int timeout_ms) {
  pollfd readable{socket, POLLIN, 0};
  int ready = 0;
  do {
    ready = ::poll(&readable, 1, timeout_ms);
  } while (ready < 0 && errno == EINTR);
  if (ready <= 0) return std::nullopt;

  LeaseHeader header{};
  std::string text(longest_text, '\0');
  std::array<iovec, 2> parts{iovec{&header, sizeof header}, iovec{text.data(), text.size()}};
  FileSpace space{};
  msghdr packet{};
  packet.msg_iov = parts.data();
  packet.msg_iovlen = parts.size();
  packet.msg_control = space.bytes.data();
  packet.msg_controllen = space.bytes.size();
  ssize_t got = ::recvmsg(socket, &packet, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  // The other side closed with a message of ours unread. What it had said before is still there.
  if (got < 0 && errno == ECONNRESET) got = ::recvmsg(socket, &packet, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  LeaseMessage message;
  for (cmsghdr* c = CMSG_FIRSTHDR(&packet); got >= 0 && c != nullptr; c = CMSG_NXTHDR(&packet, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
    const std::size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    std::array<int, most_files> files{};
    std::memcpy(files.data(), CMSG_DATA(c), sizeof(int) * std::min(count, most_files));
    for (std::size_t i = 0; i < std::min(count, most_files); ++i) message.files.emplace_back(files[i]);
  }
  if (got < static_cast<ssize_t>(sizeof header) || header.magic != lease_magic) return std::nullopt;
  message.word = static_cast<LeaseWord>(header.word);
  message.scheduling = {header.fifo_priority, header.memory_locked != 0};
  message.safe = header.safe != 0;
  text.resize(static_cast<std::size_t>(got) - sizeof header);
  message.text = std::move(text);
  return message;
}

Peer peer_of(int socket) noexcept {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return {};
  return {.pid = credentials.pid, .uid = credentials.uid, .gid = credentials.gid};
}

int listen_at(const std::string& path) {
  sockaddr_un address{};
  if (!address_of(path, address)) return -1;
  const int fd = new_socket();
  if (fd < 0) return -1;
  constexpr int waiting = 64;
  const bool listens = ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                       ::listen(fd, waiting) == 0 && ::fcntl(fd, F_SETFL, O_NONBLOCK) == 0;
  if (!listens) {
    return closed_with_errno(fd);
  }
  return fd;
}

int connect_to(const std::string& path, int within_ms) {
  sockaddr_un address{};
  if (!address_of(path, address)) return -1;
  const int fd = new_socket();
  if (fd < 0) return -1;
  const timeval longest{.tv_sec = within_ms / 1'000, .tv_usec = within_ms % 1'000 * 1'000};
  ::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof longest);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return closed_with_errno(fd);
  return fd;
}

}  // namespace abs_hil::guardian
