#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"
#include "driver/can/bus.hpp"

namespace abs_hil::driver::can {

/// What ABS_COMMAND makes of a command.
[[nodiscard]] inline OutputGrid output_grid(const CanOptions& options) noexcept {
  return {.duty_steps = duty_steps, .motor_duty_max = options.motor_duty_max, .brake_duty_max = options.brake_duty_max};
}

/// What is wrong with a frame or a cycle. The larger the number, the more it tells about the cause.
enum class Anomaly : std::uint8_t {
  none = 0,
  missing,       ///< no answer in time
  queue_full,    ///< the SYNC or the command could not be sent
  stale,         ///< an answer to an earlier SYNC
  out_of_order,  ///< a sequence ahead of the SYNC, or the answer's two frames in the wrong order
  duplicate,     ///< the same frame again
  too_many,      ///< more frames than a cycle reads, or frames that the kernel dropped
  implausible,   ///< a signal out of its range
  forged,        ///< a frame with the node's identifier and a wrong checksum
  wrong_length,
};
inline constexpr std::size_t anomaly_count = 10;

/// The node's counters, clock and state at one SYNC.
struct Answer {
  Values values{};
  unsigned count_bits{24};  ///< width of the wheels' counters
};

/// Assembles the answer to one SYNC from its frames and finds frames that do not belong to it. Real-time safe.
class AnswerTracker {
 public:
  /// Starts anew before the first SYNC; `sequence` is the sequence before it.
  void reset(std::uint8_t sequence) noexcept {
    *this = {};
    expected_ = last_ = sequence;
  }
  /// Expects the answer to a SYNC that was sent with this sequence.
  void expect(std::uint8_t sequence) noexcept {
    expected_ = sequence;
    has_encoders_ = has_latch_ = false;
    answer_ = {};
  }

  /// Takes ABS_ENCODERS, ABS_LATCH or ABS_MEASUREMENT.
  Anomaly take(std::uint32_t identifier, const Values& values) noexcept {
    if (const Anomaly anomaly = place(values.sequence); anomaly != Anomaly::none) return anomaly;
    const bool encoders = identifier != id::latch;
    const bool latch = identifier != id::encoders;
    if ((encoders && has_encoders_) || (latch && has_latch_)) return Anomaly::duplicate;
    // The latch should have come last. The answer is still valid.
    const Anomaly anomaly = encoders && has_latch_ ? Anomaly::out_of_order : Anomaly::none;
    if (encoders) {
      answer_.values.upper_counts = values.upper_counts;
      answer_.values.lower_counts = values.lower_counts;
      answer_.count_bits = latch ? 32 : 24;
      has_encoders_ = true;
    }
    if (latch) {
      answer_.values.lever_counts = values.lever_counts;
      answer_.values.node_time_us = values.node_time_us;
      answer_.values.node_state = values.node_state;
      has_latch_ = true;
    }
    if (complete()) {
      last_ = expected_;
      any_ = true;
    }
    return anomaly;
  }

  /// `none` if a frame with this sequence belongs to the expected SYNC.
  [[nodiscard]] Anomaly place(std::int64_t sequence) const noexcept {
    constexpr std::uint8_t half = 128;
    const auto behind = static_cast<std::uint8_t>(expected_ - sequence);
    if (behind == 0) return Anomaly::none;
    if (behind >= half) return Anomaly::out_of_order;
    return any_ && sequence == last_ ? Anomaly::duplicate : Anomaly::stale;
  }
  [[nodiscard]] bool complete() const noexcept { return has_encoders_ && has_latch_; }
  /// The answer to the expected SYNC; valid once complete.
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }
  /// Sequence of the last complete answer.
  [[nodiscard]] std::uint8_t last_sequence() const noexcept { return last_; }

 private:
  std::uint8_t expected_{0};
  std::uint8_t last_{0};
  bool any_{false};  ///< `last_` is the sequence of an answer
  bool has_encoders_{false};
  bool has_latch_{false};
  Answer answer_{};
};

inline constexpr std::int64_t handshake_timeout_ns = 100'000'000;
inline constexpr int handshake_attempts = 3;
inline constexpr std::int64_t can_make_safe_bound_ns = handshake_attempts * handshake_timeout_ns;

/// Counts of frames and cycles since `configure`.
struct CanCounters {
  std::uint64_t cycles{0};  ///< SYNCs
  std::array<std::uint64_t, anomaly_count> anomalies{};
  std::uint64_t error_frames{0};
  std::uint64_t error_warnings{0};
  std::uint64_t dropped_by_kernel{0};
  std::uint64_t rejected_by_node{0};
  std::int64_t longest_answer_ns{0};
  [[nodiscard]] std::uint64_t of(Anomaly anomaly) const noexcept {
    return anomalies[static_cast<std::size_t>(anomaly)];
  }
};

using OpenLink = std::function<Link()>;

/// The rig behind a CAN I/O node (docs/can.md). Not verified on hardware.
///
/// One cycle: `read` sends ABS_SYNC and waits for the answer, at most `driver.can.answer_timeout_us`; `write` sends
/// ABS_COMMAND and does not wait. The driver tolerates single losses: it returns the previous measurement again, with
/// its time stamp. Sustained loss, and every state of the bus in which the node cannot be reached, fails `read` or
/// `write` with its own reason. Without commands the node's watchdog zeroes the outputs.
class CanDriver final : public BoardDriver {
 public:
  /// Throws std::invalid_argument, naming the key, if an option is outside its range.
  /// @param open_link  called by `configure`; throws Unavailable
  /// @param lock_step  this driver advances the time of the node, which must be an emulator in lock-step
  CanDriver(const CanOptions& options, OpenLink open_link, bool lock_step);
  ~CanDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "can"; }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] std::vector<std::string> tally() const override;
  [[nodiscard]] std::string_view what_holds_unsafe() const noexcept override {
    return "the node's watchdog should have zeroed them, if the node works";
  }
  [[nodiscard]] std::vector<std::string> inspection() override;
  [[nodiscard]] std::int64_t make_safe_bound_ns() const noexcept override { return can_make_safe_bound_ns; }
  [[nodiscard]] BoardIdentity identity() const override;
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override;
  [[nodiscard]] const CanCounters& counters() const noexcept { return counters_; }

 private:
  /// Raw values: steps of 0.0001.
  struct Duties {
    std::int64_t brake{0};
    std::int64_t drive{0};
    bool operator==(const Duties&) const = default;
  };

  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& went_out) noexcept override;
  IoResult do_make_safe() noexcept override;

  // The handshake.
  void identify();
  [[nodiscard]] IoResult deactivate_node() noexcept;
  [[nodiscard]] IoResult activate_node() noexcept;
  /// Waits until `heard` returns true for a message of the node, at most `handshake_timeout_ns`.
  template <class Heard>
  [[nodiscard]] bool await(Heard heard) noexcept;
  /// Waits until the node reports this state, and both outputs 0.
  [[nodiscard]] bool await_state(NodeState wanted) noexcept;

  // One cycle.
  [[nodiscard]] IoResult exchange(std::int64_t now_ns) noexcept;
  [[nodiscard]] IoResult send_sync(std::int64_t now_ns) noexcept;
  [[nodiscard]] IoResult collect() noexcept;
  [[nodiscard]] IoResult take(const Frame& frame) noexcept;
  [[nodiscard]] IoResult take_error_frame(const Frame& frame) noexcept;
  void take_message(const Decoded& message) noexcept;
  void take_values(const Decoded& message) noexcept;
  void note(Anomaly anomaly) noexcept;
  void check_drops() noexcept;
  [[nodiscard]] IoResult judge(std::int64_t now_ns) noexcept;
  [[nodiscard]] IoResult judge_answer(std::int64_t now_ns) noexcept;
  [[nodiscard]] IoResult tripped() noexcept;
  [[nodiscard]] bool advance_counts(const Answer& answer, std::int64_t elapsed_ns) noexcept;
  [[nodiscard]] std::int64_t node_interval_ns(const Answer& answer) const noexcept;
  [[nodiscard]] std::int64_t latch_time_ns(const Answer& answer, std::int64_t now_ns) const noexcept;
  [[nodiscard]] IoResult sent(const IoResult& result) noexcept;
  IoResult send_command(const Duties& duties, bool drive_enable) noexcept;
  [[nodiscard]] Frame in_format(Frame frame) const noexcept;

  CanOptions options_;
  OpenLink open_link_;
  bool lock_step_;
  std::int64_t answer_timeout_ns_;
  Link link_{};
  bool fd_{false};
  Values identity_{};
  CanCounters counters_{};

  // State of the cycle.
  LossBucket bucket_;
  AnswerTracker tracker_{};
  std::uint8_t sync_{0};
  std::int64_t sent_ns_{0};
  std::int64_t received_ns_{0};
  Anomaly worst_{Anomaly::none};
  std::uint32_t worst_id_{0};
  std::uint32_t drops_seen_{0};
  std::int64_t rejected_seen_{0};

  // Last values from the node.
  bool any_answer_{false};
  std::array<std::uint32_t, 2> raw_counts_{};  ///< upper, lower; the node's own counters
  std::array<std::int32_t, 2> counts_{};       ///< upper, lower; 32 bits, after `upper_sign` and `lower_sign`
  std::int64_t node_time_us_{0};
  std::int64_t latched_ns_{0};
  double supply_V_{rig::unknown};
  double temperature_C_{rig::unknown};
  std::uint32_t trip_flags_{0};
  int answers_since_status_{0};
  int answers_since_outputs_{0};

  // Commands sent, by sequence.
  std::uint8_t command_sequence_{0};
  std::array<Duties, 256> commanded_{};
  rig::Command command_sent_{};  ///< the last one that the interface took
  bool outputs_known_{false};
  Duties applied_{};
  std::uint8_t applied_sequence_{0};
};

/// Makes the writer of a CAN node's safe state: it sends the request to deactivate, and zeros, without any handshake,
/// and waits afterwards until the node reports that it is inactive with both outputs 0. A bus takes more than one
/// socket, so this one is open beside the owner's. An emulator's socket takes one peer only, so it is opened after the
/// owner's end.
/// @param open_link  does not wait
/// @param one_peer   the link takes one peer only
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(OpenLink open_link, bool one_peer);

}  // namespace abs_hil::driver::can
