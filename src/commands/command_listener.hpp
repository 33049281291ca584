#pragma once

#include <lcm/lcm.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <variant>

#include "abs_hil/command2_t.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/udpm_receiver.hpp"

namespace abs_hil::telemetry {

/// What is to be answered to a command2_t.
struct CommandAnswer {
  rig::Reason reason{rig::Reason::none};
  std::string message;
  bool authentic{false};  ///< the sender proved who it is: always answered
};

/// Decides about a well-formed command2_t; none: it was taken, and the answer follows when it has taken effect.
using CommandJudge = std::function<std::optional<CommandAnswer>(const command2_t&)>;

/// Takes ABS_COMMAND from the network. `stop` is always accepted; a command2_t is put before the judge; anything else
/// is refused and counted. Answers go out on ABS_EVENT, to those who prove nothing at most ten a second of run time.
/// Received is either by poll(), or, after listen(), in a thread of its own, where a `stop` takes effect at once.
class CommandListener {
 public:
  /// What came in so far.
  struct Counts {
    std::uint64_t stops{0};
    std::uint64_t refused{0};    ///< well-formed, but unknown or not permitted
    std::uint64_t malformed{0};  ///< garbage, truncated, or of another type
    /// Came faster than they could be answered, stops never among them; and what the kernel dropped of all channels,
    /// as it came faster than it could be looked at.
    std::uint64_t dropped{0};
  };

  /// Outlet and stream must outlive the listener. `on_stop` is called once for every stop; it must not throw, and after
  /// listen() it is called in the listening thread. With udpm this process receives its own traffic too, without
  /// liblcm (udpm_receiver.hpp). Throws LcmError where udpm's group cannot be joined.
  CommandListener(LcmOutlet& outlet, MessageStream& stream, std::function<void()> on_stop);
  CommandListener(const CommandListener&) = delete;
  CommandListener& operator=(const CommandListener&) = delete;
  ~CommandListener();

  /// Without one every command2_t is refused as not enabled.
  void set_judge(CommandJudge judge) { judge_ = std::move(judge); }
  /// Starts the thread. Nothing where the provider cannot receive (file://).
  void listen();
  /// Answers what has arrived, at most 32 messages, and receives it first where there is no thread. Never waits. To be
  /// called from the stream's thread, some 10 to 100 times a second.
  void poll();
  /// Takes in nothing from now on, and answers what has arrived: no stop is taken without an answer. Waits for the
  /// thread, 50 ms at most (tcpq: 200 ms). From the stream's thread.
  void finish();

  /// False where the provider cannot receive (file://), and after finish().
  [[nodiscard]] bool listening() const noexcept { return listening_; }
  [[nodiscard]] bool stop_requested() const noexcept { return stops_.load(std::memory_order_acquire) > 0; }
  [[nodiscard]] Counts counts() const noexcept;

 private:
  static constexpr std::size_t max_packet_bytes = UdpmReceiver::payload_max;
  /// As it came through liblcm.
  struct Packet {
    std::array<std::uint8_t, max_packet_bytes> bytes{};
    std::size_t size{0};  ///< as received; larger than `bytes` if it did not fit
    bool arrived{false};
  };
  /// What the answering thread learns of a packet.
  struct Problem {
    std::string_view text;
  };
  using Arrival = std::variant<Problem, command_t, command2_t>;

  static void on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept;
  [[nodiscard]] int file_descriptor() noexcept { return udpm_ ? udpm_->file_descriptor() : lcm_get_fileno(lcm_); }
  /// Handles one packet if one is there within `timeout_ms`. False if none came or nothing can be received now.
  bool receive(int timeout_ms);
  void take(std::span<const std::uint8_t> packet);
  void hand_over(Arrival arrival, bool is_stop);
  void subscribe();
  void end_thread();
  void answer_waiting(std::size_t at_most);
  void listen_until(const std::stop_token& stop);
  void answer(const Arrival& arrival);
  void say(rig::Reason reason, std::string message, std::uint64_t count, bool always);

  LcmOutlet& outlet_;
  MessageStream& stream_;
  std::function<void()> on_stop_;
  CommandJudge judge_;
  std::optional<UdpmReceiver> udpm_;
  /// Where it is not udpm. Of its own, so that what floods in cannot hold up what goes out; memq:// delivers within one
  /// object only.
  std::unique_ptr<lcm::LCM> own_lcm_;
  lcm_t* lcm_{nullptr};
  lcm_subscription_t* subscription_{nullptr};
  bool listening_{false};
  Packet packet_{};
  std::mutex mutex_;  ///< of the two slow threads
  std::deque<Arrival> arrivals_;
  std::atomic<std::uint64_t> stops_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::uint64_t> dropped_by_kernel_{0};
  std::uint64_t stops_answered_{0};
  std::uint64_t refused_{0};
  std::uint64_t malformed_{0};
  double answer_window_start_s_{0.0};
  int answers_in_window_{0};
  std::jthread thread_;
};

}  // namespace abs_hil::telemetry
