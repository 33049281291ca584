#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/file_descriptor.hpp"
#include "guardian/guardian_loop.hpp"
#include "guardian/lease_wire.hpp"
#include "guardian/options.hpp"
#include "runtime/clock.hpp"
#include "runtime/scheduling.hpp"

namespace abs_hil::guardian {

/// What a run asks of the service for one `cover`.
struct LeaseTerms {
  GuardianOptions options{};
  std::string board{};  ///< the board that the run drives: kind and place (ServiceParts::board)
  /// Writes the flight record, with the rights of the client. It must not block the service.
  std::function<void(const SharedRegion&, const GuardianReport&, const std::string& account)> write_record{};
};

/// Something outside of the runs that the service must attend to: a signal, a suspension, a pause of the machine.
struct Interruption {
  int descriptor{-1};  ///< readable when it happens
  /// Reads the descriptor. Returns why a lease must end; `none`: nothing but a new look at the board is needed.
  std::function<rig::Reason()> take;
  /// Called when a lease is granted and when it has ended.
  std::function<void(bool held)> lease_changed{};
  /// Why nobody gets a lease at present; empty: no objection.
  std::function<std::string()> bars_leases{};
  /// Called once nobody has a lease and the board was made safe, or could not be.
  std::function<void(bool safe)> dealt_with{};
};

struct ServiceParts {
  driver::FileDescriptor listener;  ///< a listening socket (listen_at)
  /// The board that the service keeps, as text; clients must name the same.
  std::string board;
  /// Throws driver::Unavailable.
  std::function<std::unique_ptr<driver::SafeStateWriter>()> make_writer;
  /// Reads a launch config. Throws std::exception if it cannot be guarded.
  std::function<LeaseTerms(const std::string& launch_config_json, const Peer& client)> read_terms;
  std::vector<Interruption> interruptions{};
  runtime::Scheduling scheduling{};  ///< of the thread that calls `run`
  std::string shortcomings{};        ///< what it could not obtain of the real-time set-up
  std::int64_t keep_ns{250'000'000};
  std::function<void(const std::string&)> tell;    ///< a line for the log
  std::function<void(const std::string&)> status;  ///< the service's state, for the service manager
  std::function<void()> alive;                     ///< sign of life for the service manager, about ten times a second
};

/// The resident guardian. Without a lease it keeps the board's outputs at zero and verifies it, for as long as the
/// board is there. It grants one lease at a time. During a lease it does what the guardian of a single run does
/// (GuardianLoop); afterwards the outputs are its own again, and it never gives up.
///
/// `run` is one thread and the only one that touches the board.
class GuardianService {
 public:
  GuardianService(runtime::Clock& clock, ServiceParts parts);
  GuardianService(const GuardianService&) = delete;
  GuardianService& operator=(const GuardianService&) = delete;
  ~GuardianService();

  /// Makes the board safe for the first time.
  void start();
  /// Serves until an interruption with reason `guardian_told_to_end`. Returns true if the outputs were verified at the
  /// end.
  [[nodiscard]] bool run();

 private:
  class Holder;
  struct Client {
    driver::FileDescriptor socket;
    driver::FileDescriptor pidfd;
    Peer peer{};
    bool gone{false};
    bool closed{false};  ///< its socket
  };
  struct Woken {
    bool visitor{false};
    bool spoke{false};
  };

  [[nodiscard]] Woken wait(std::int64_t until_ns);
  void receive_caller();
  void hear_caller();
  void receive_visitor();
  /// Answers questions about the state; false for anything else.
  [[nodiscard]] bool answer(int socket, const LeaseMessage& asked);
  void answer_safe_caller(const std::string& holder);
  [[nodiscard]] bool keeps_one_of(const std::string& boards) const;
  [[nodiscard]] std::string why_no_lease(const LeaseMessage& asked, const Peer& peer);
  void serve(Client client);
  void cover(const LeaseMessage& message);
  void keep();
  void tell_lease(bool held);
  void deal_with_interruptions();
  [[nodiscard]] bool former_client_gone();

  runtime::Clock& clock_;
  ServiceParts parts_;
  std::unique_ptr<driver::SafeStateWriter> writer_{};
  std::unique_ptr<Client> client_{};        ///< holds the lease
  driver::FileDescriptor caller_{-1};       ///< connected while another has the lease, and has not spoken yet
  driver::FileDescriptor safe_caller_{-1};  ///< waits until the lease has ended
  driver::FileDescriptor former_{-1};       ///< pidfd of a client that was ended and is not gone yet
  pid_t former_pid_{0};
  driver::IoResult board_result_{};
  bool board_known_{false};
  bool safe_{false};
  rig::Reason pending_{rig::Reason::none};
  bool interrupted_{false};
  bool ending_{false};
  std::int64_t next_keep_ns_{0};
  std::int64_t next_alive_ns_{0};
};

}  // namespace abs_hil::guardian
