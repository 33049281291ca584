#include "guardian/service_call.hpp"

#include <cerrno>
#include <cstring>

#include "guardian/lease_wire.hpp"

namespace abs_hil::guardian {

namespace {

/// The service may be busy with a board that does not answer, or end a run first.
constexpr int call_answered_within_ms = 20'000;

std::optional<ServiceAnswer> call(const std::string& path, const LeaseMessage& message) {
  const driver::FileDescriptor socket(connect_to(path));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return std::nullopt;
    const std::string why = std::strerror(errno);
    return ServiceAnswer{.text = why + (errno == EACCES ? ": join the group abs_hil and log in again" : "")};
  }
  ServiceAnswer said{.service = peer_of(socket.get()).pid, .text = "it gave no answer"};
  static_cast<void>(send_message(socket.get(), message));
  if (const auto answer = receive_message(socket.get(), call_answered_within_ms)) {
    said.keeps_it = answer->word == LeaseWord::answer;
    said.safe = said.keeps_it && answer->safe;
    said.text = answer->text;
  }
  return said;
}

}  // namespace

std::optional<ServiceAnswer> service_state(const std::string& socket) {
  return call(socket, {.word = LeaseWord::state});
}

std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards) {
  return call(socket, {.word = LeaseWord::make_safe, .text = boards});
}

}  // namespace abs_hil::guardian
