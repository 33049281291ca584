#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "driver/file_descriptor.hpp"
#include "guardian/lease_wire.hpp"
#include "guardian/machine.hpp"
#include "guardian/mail.hpp"
#include "guardian/shared_region.hpp"
#include "runtime/clock.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// What a run asks for with one `cover`.
struct LeaseTerms {
  std::int64_t timeout_ns{0};  ///< guardian.timeout_ms of the run
  std::string board{};         ///< the board that the run drives: kind and place (kept_board)
  /// Writes the flight record, with the rights of the client.
  std::function<void(const SharedRecorder&, const GuardianReport&, const std::string& account)> write_record{};
};

struct TalkerParts {
  runtime::Clock& clock;
  Mail& mail;
  ServicePage& page;
  int listener{-1};   ///< a listening socket (listen_at)
  std::string board;  ///< the board that the guard keeps, as text; clients must name the same
  /// The process at the other end of a socket, if `pidfd` is its pidfd; otherwise its pid is 0.
  std::function<Peer(int socket, int pidfd)> identify;
  /// Reads a launch config. Throws std::exception if it cannot be guarded.
  std::function<LeaseTerms(const std::string& launch_config_json, const Peer& client)> read_terms;
  MachinePause* pause{nullptr};                    ///< null: none can be found here
  runtime::Scheduling scheduling{};                ///< of the guard
  std::string shortcomings{};                      ///< what the guard could not obtain of the real-time set-up
  std::function<void(const std::string&)> tell;    ///< a line for the log
  std::function<void(const std::string&)> status;  ///< the service's state, for the service manager
};

/// A connection.
struct TalkerClient {
  driver::FileDescriptor socket;
  std::int64_t since_ns{0};
  Peer peer{};
  driver::FileDescriptor pidfd{-1};  ///< of one that asks for the lease
  bool asks{false};                  ///< for the lease, and has not got an answer
  bool waits_for_safe{false};        ///< for the answer to `make_safe`
  bool gone{false};                  ///< its connection is closed
};
/// The lease, as the talker knows it.
struct HeldLease {
  std::uint32_t lease{0};
  int socket{-1};  ///< the holder's; -1: it has closed its connection
  std::string name{};
  Peer peer{};
  std::optional<SharedRecorder> recorder{};
  LeaseTerms terms{};
};

/// The resident service's mouth and ears, in a process of its own: it accepts connections, reads messages, maps
/// recorders, writes records and the log. It grants nothing itself: it puts what clients want before the guard as
/// orders and tells them the guard's news. All of it may take as long as it likes, or die, without delaying the guard.
class Talker {
 public:
  explicit Talker(TalkerParts parts) : parts_(std::move(parts)) {}
  /// Waits for something to happen, at most `timeout_ms`, and deals with it.
  void step(int timeout_ms);

 private:
  using Client = TalkerClient;

  [[nodiscard]] bool holds(const Client& client) const { return held_ && held_->socket == client.socket.get(); }
  /// It has not said yet what it wants, or has got its answer.
  [[nodiscard]] bool is_silent(const Client& client) const {
    return !client.asks && !client.waits_for_safe && !holds(client);
  }
  void accept_clients();
  void hear(Client& client);
  void answer_state(const Client& client);
  void ask_for_safe(Client& client, const LeaseMessage& said);
  void take_request(Client& client, LeaseMessage& asked);
  [[nodiscard]] std::string why_no_lease(const LeaseMessage& asked, const Peer& peer) const;
  void refuse(Client& client, const std::string& why);
  void ask_guard_for_next();
  void cover(Client& client, const LeaseMessage& message);
  void hear_guard();
  void take_news(const News& news, const std::vector<driver::FileDescriptor>& pages);
  void give_lease(const News& news, const std::vector<driver::FileDescriptor>& pages);
  void end_lease(const News& news);
  void answer_safe_callers(const std::string& what);
  void order(const Order& order);
  void close_holder();
  void drop(Client& client);
  [[nodiscard]] Client* client_of(int socket);
  [[nodiscard]] std::string outputs_text() const;

  TalkerParts parts_;
  std::vector<Client> clients_{};
  std::vector<Order> outbox_{};
  std::int64_t next_look_ns_{0};  ///< a flood of requests must not keep the guard at the board
  int asking_{-1};                ///< socket of the client for whom the guard was asked for a lease
  std::optional<HeldLease> held_{};
  News latest_{};
  bool knows_board_{false};
};

}  // namespace abs_hil::guardian
