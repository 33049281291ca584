// Sends and receives the packets between controller and service, with their descriptors.
#include "guardian/lease_wire.hpp"

#include <grp.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "driver/monotonic_time.hpp"
#include "guardian/linux_process.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::uint32_t lease_magic = 0x6C656132;  // a later protocol has another number
constexpr std::size_t longest_text = 60'000;

struct LeaseHeader {
  std::uint32_t magic{lease_magic};
  std::uint32_t word{0};
  std::int32_t fifo_priority{0};
  std::uint8_t memory_locked{0};
  std::uint8_t safe{0};
  std::uint8_t unused[2]{};
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

int new_socket() { return ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0); }

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
  const std::array<iovec, 2> parts{iovec{&header, sizeof header}, iovec{text.data(), text.size()}};
  return send_packet(socket, parts, {files.begin(), files.size()});
}

std::optional<LeaseMessage> receive_message(int socket, int timeout_ms) {
  if (!is_readable(socket, timeout_ms)) return std::nullopt;
  LeaseHeader header{};
  std::string text(longest_text, '\0');
  std::array<iovec, 2> parts{iovec{&header, sizeof header}, iovec{text.data(), text.size()}};
  LeaseMessage message;
  const ssize_t got = receive_packet(socket, parts, message.files);
  if (got < static_cast<ssize_t>(sizeof header) || header.magic != lease_magic) return std::nullopt;
  message.word = static_cast<LeaseWord>(header.word);
  message.scheduling = {header.fifo_priority, header.memory_locked != 0};
  message.safe = header.safe != 0;
  text.resize(static_cast<std::size_t>(got) - sizeof header);
  message.text = std::move(text);
  return message;
}

Peer peer_of(int socket) noexcept {
  Peer peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 ? peer : Peer{};
}

int listen_at(const std::string& path) {
  sockaddr_un address{};
  if (!address_of(path, address)) return -1;
  const int fd = new_socket();
  constexpr int waiting = 64;
  const bool listens = fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                       ::listen(fd, waiting) == 0;
  return listens ? fd : closed_with_errno(fd);
}

int connect_to(const std::string& path, std::int64_t within_ns) {
  sockaddr_un address{};
  if (!address_of(path, address)) return -1;
  const int fd = new_socket();
  if (fd < 0) return -1;
  const std::int64_t end_ns = driver::monotonic_ns() + within_ns;
  // A connect that may wait would wait for as long as the service's queue is full. This one may not, and is repeated.
  while (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    constexpr int pause_ms = 5;
    if ((errno != EAGAIN && errno != EINTR) || driver::monotonic_ns() >= end_ns) return closed_with_errno(fd);
    static_cast<void>(::poll(nullptr, 0, pause_ms));
  }
  return fd;
}

void open_for_group(const std::string& path) {
  const group* const members = ::getgrnam("abs_hil");
  if (members != nullptr) {
    [[maybe_unused]] const int changed = ::chown(path.c_str(), static_cast<uid_t>(-1), members->gr_gid);
  }
  ::chmod(path.c_str(), S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP);
}

}  // namespace abs_hil::guardian
