#pragma once

#include <lcm/lcm.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "abs_hil/telemetry/lcm_outlet.hpp"
#include "abs_hil/telemetry/message_stream.hpp"

namespace abs_hil::telemetry {

/// Takes ABS_COMMAND from the network. `stop` is always accepted; anything else is refused, counted and answered on
/// ABS_EVENT, at most ten answers a second of run time. Used from the thread of its outlet and stream.
class CommandListener {
 public:
  /// What came in so far.
  struct Counts {
    std::uint64_t stops{0};
    std::uint64_t refused{0};    ///< well-formed but not a known command
    std::uint64_t malformed{0};  ///< garbage, truncated, or of another type
  };

  /// Subscribes; both must outlive the listener. `on_stop` is called from poll(), once for every stop; it must not
  /// throw. With udpm this process then receives its own traffic too.
  CommandListener(LcmOutlet& outlet, MessageStream& stream, std::function<void()> on_stop);
  CommandListener(const CommandListener&) = delete;
  CommandListener& operator=(const CommandListener&) = delete;
  ~CommandListener();

  /// Handles what has arrived, at most 32 messages, without waiting. Call it some 10 to 100 times a second.
  void poll();

  /// False where the provider cannot receive (file://).
  [[nodiscard]] bool listening() const noexcept { return subscription_ != nullptr; }
  [[nodiscard]] bool stop_requested() const noexcept { return counts_.stops > 0; }
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  static constexpr std::size_t max_packet_bytes = 2048;
  struct Packet {
    std::array<std::uint8_t, max_packet_bytes> bytes;
    std::size_t size{0};  ///< as received; larger than `bytes` if it did not fit
    bool arrived{false};
  };

  static void on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept;
  void take(std::span<const std::uint8_t> packet);
  void answer(rig::Reason reason, std::string message, std::uint64_t count);

  LcmOutlet& outlet_;
  MessageStream& stream_;
  std::function<void()> on_stop_;
  lcm_subscription_t* subscription_{nullptr};
  Packet packet_{};
  Counts counts_;
  double answer_window_start_s_{0.0};
  int answers_in_window_{0};
};

}  // namespace abs_hil::telemetry
