#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "driver/file_descriptor.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// What controller and resident service say to each other, one packet each on a Unix socket (SOCK_SEQPACKET):
///
///     controller                                     service
///     ask     text: the board; its pidfd      ->
///                                             <-     granted with both pages, or refused with the reason in text
///     cover   flight recorder, launch config  ->             the guard now watches the run
///                                             <-     ready   with its scheduling, text: what it lacks; or refused
///     (stage closed, in the run's page)                      the controller is done
///     (ends, in the guard's page)                            the guard has read the board back
///
/// `cover` to `ends` may be repeated. The lease ends when the controller's process ends or its socket closes.
///
/// Every process that may connect may also ask for other things, at any time, also while a run has the lease:
///
///     state                                   ->
///     make_safe  text: names of the board, one a line
///                                             ->             the service ends the lease and makes the outputs safe
///                                             <-     answer  safe: verified, text: who has, or had, the lease
enum class LeaseWord : std::uint32_t { ask = 1, granted, refused, cover, ready, state, make_safe, answer };

struct LeaseMessage {
  LeaseWord word{LeaseWord::ask};
  runtime::Scheduling scheduling{};  ///< of `ready`
  bool safe{false};                  ///< of `answer`
  std::string text{};                ///< at most 60,000 characters are sent
  std::vector<driver::FileDescriptor> files{};
};

/// Sends a message and copies of `files`. False and errno if it could not be sent whole, at once.
[[nodiscard]] bool send_message(int socket, const LeaseMessage& message, std::initializer_list<int> files = {});
/// Receives the next message, if there is one within `timeout_ms`. Nothing after the other side's end, and for a packet
/// that is no message of this build.
[[nodiscard]] std::optional<LeaseMessage> receive_message(int socket, int timeout_ms);

/// The process at the other end; its pid is 0 if that is unknown.
using Peer = ::ucred;
[[nodiscard]] Peer peer_of(int socket) noexcept;

/// A socket bound to `path`, or connected to it. Returns a descriptor, or -1 and errno. A service that stands still
/// accepts nobody: once its queue is full, connect_to() fails with EAGAIN after `within_ns`.
[[nodiscard]] int listen_at(const std::string& path);
[[nodiscard]] int connect_to(const std::string& path, std::int64_t within_ns = 2 * rig::ns_per_s);
/// Members of the group abs_hil may ask for leases, as they may open the boards.
void open_for_group(const std::string& path);

}  // namespace abs_hil::guardian
