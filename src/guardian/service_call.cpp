#include "guardian/service_call.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/lease_wire.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::int64_t state_within_ns = 2000 * rig::ns_per_ms;
constexpr std::int64_t safe_within_ns = 300 * rig::ns_per_ms;

/// A socket connected to `path` before `end_ns`. A connect that may wait would wait for as long as the service's queue
/// is full; one that may not gives EAGAIN, and is tried again.
driver::FileDescriptor connected(const std::string& path, std::int64_t end_ns) {
  constexpr int pause_ms = 5;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  errno = ENAMETOOLONG;
  if (path.empty() || path.size() >= sizeof address.sun_path) return driver::FileDescriptor(-1);
  std::copy(path.begin(), path.end(), address.sun_path);
  driver::FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  while (socket.get() >= 0 &&
         ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    if ((error == EAGAIN || error == EINTR) && driver::monotonic_ns() < end_ns) {
      static_cast<void>(::poll(nullptr, 0, pause_ms));
      continue;
    }
    socket = driver::FileDescriptor(-1);
    errno = error;  // closing may have changed it
  }
  return socket;
}

std::string why_not(int error) {
  if (error == EAGAIN) return "its queue of visitors is full";
  return std::string(std::strerror(error)) + (error == EACCES ? ": join the group abs_hil and log in again" : "");
}

std::optional<ServiceAnswer> call(const std::string& path, const LeaseMessage& message, std::int64_t within_ns) {
  const std::int64_t end_ns = driver::monotonic_ns() + within_ns;
  const driver::FileDescriptor socket = connected(path, end_ns);
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return std::nullopt;
    return ServiceAnswer{.text = why_not(errno)};
  }
  ServiceAnswer said{.service = peer_of(socket.get()).pid,
                     .text = "it gave no answer within " + std::to_string(within_ns / rig::ns_per_ms) + " ms"};
  static_cast<void>(send_message(socket.get(), message));
  const std::int64_t left_ms = std::max<std::int64_t>(0, end_ns - driver::monotonic_ns()) / rig::ns_per_ms;
  if (const auto answer = receive_message(socket.get(), static_cast<int>(left_ms))) {
    said.answered = true;
    said.keeps_it = answer->word == LeaseWord::answer;
    said.safe = said.keeps_it && answer->safe;
    said.text = answer->text;
  }
  return said;
}

}  // namespace

std::optional<ServiceAnswer> service_state(const std::string& socket) {
  return call(socket, {.word = LeaseWord::state}, state_within_ns);
}

std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards) {
  return call(socket, {.word = LeaseWord::make_safe, .text = boards}, safe_within_ns);
}

}  // namespace abs_hil::guardian
