#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <variant>

#include "abs_hil/command_t.hpp"
#include "commands/receiver.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::commands {

/// The answer to a command_t.
struct CommandAnswer {
  rig::Reason reason{rig::Reason::none};
  std::string message;
  bool authentic{false};  ///< the sender holds the key; such a sender always gets an answer
};

/// Judges a well-formed command_t. Returns nothing if the command was accepted; its answer follows when it takes
/// effect.
using CommandJudge = std::function<std::optional<CommandAnswer>(const command_t&)>;

/// Receives ABS_COMMAND from the network. It always accepts `stop`, passes every other command to the judge, and
/// counts what is no command. Answers go out on ABS_EVENT, at most ten per second of run time to unauthenticated
/// senders. Messages are received by poll() or, after listen(), in a thread of its own, where a `stop` takes effect at
/// once.
class CommandListener {
 public:
  /// Counts of received messages so far.
  struct Counts {
    std::uint64_t stops{0};
    std::uint64_t refused{0};    ///< well-formed, but unknown or not permitted
    std::uint64_t malformed{0};  ///< garbage, truncated, or of another type
    /// Messages that arrived faster than they could be answered (never a stop), and packets on any channel that the
    /// kernel dropped because they arrived faster than they were read.
    std::uint64_t dropped{0};
  };

  /// Outlet and stream must outlive the listener. `on_stop` is called once for every stop; it must not throw; after
  /// listen() it runs in the listening thread. With udpm the listener receives without liblcm (UdpmReceiver) and
  /// also gets this process's own traffic. Throws LcmError if it cannot join udpm's multicast group.
  CommandListener(telemetry::LcmOutlet& outlet, telemetry::MessageStream& stream, std::function<void()> on_stop);

  /// Sets the judge. Without one every command_t is refused as not enabled.
  void set_judge(CommandJudge judge) { judge_ = std::move(judge); }
  /// Starts the listening thread. Does nothing if the provider cannot receive (file://).
  void listen();
  /// Answers at most 32 waiting messages; without a listening thread it receives them first. Never waits. Call it from
  /// the stream's thread, 10 to 100 times a second.
  void poll();
  /// Stops receiving and answers every message that has arrived, so that no accepted stop stays unanswered. Waits for
  /// the thread, at most 50 ms (tcpq: 200 ms). Call it from the stream's thread.
  void finish();

  /// False if the provider cannot receive (file://), and after finish().
  [[nodiscard]] bool listening() const noexcept { return listening_; }
  [[nodiscard]] bool stop_requested() const noexcept { return stops_.load(std::memory_order_acquire) > 0; }
  [[nodiscard]] Counts counts() const noexcept;

 private:
  /// A command, or what is wrong with a packet that is none.
  using Arrival = std::variant<std::string_view, command_t>;

  [[nodiscard]] int file_descriptor() noexcept {
    return udpm_ ? udpm_->file_descriptor() : receiver_->file_descriptor();
  }
  /// Waits up to `timeout_ms` for one packet and handles it. Returns false if none came or the link is down.
  bool receive(int timeout_ms);
  void take(std::span<const std::uint8_t> packet);
  void hand_over(Arrival arrival, bool is_stop);
  void end_thread();
  void answer_waiting(std::size_t at_most);
  void listen_until(const std::stop_token& stop);
  void answer(const Arrival& arrival);
  void say(rig::Reason reason, std::string message, std::uint64_t count, bool always);

  telemetry::LcmOutlet& outlet_;
  telemetry::MessageStream& stream_;
  std::function<void()> on_stop_;
  CommandJudge judge_;
  std::optional<UdpmReceiver> udpm_;
  /// Of all providers but udpm. It is separate from the outlet, so that incoming floods cannot delay outgoing messages;
  /// only that of memq:// shares it.
  std::optional<Receiver> receiver_;
  bool listening_{false};
  std::mutex mutex_;  ///< guards `arrivals_` between the listening and the answering thread
  std::deque<Arrival> arrivals_;
  std::atomic<std::uint64_t> stops_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::uint64_t> dropped_by_kernel_{0};
  std::uint64_t stops_answered_{0};
  std::uint64_t refused_{0};
  std::uint64_t malformed_{0};
  double answer_window_start_s_{0.0};
  int answers_in_window_{0};
  std::jthread thread_;  ///< the last member: it ends first
};

}  // namespace abs_hil::commands
