// Which frames of the node belong to the SYNC that was sent last.

#pragma once

#include <cstdint>

#include "driver/can/protocol.hpp"

namespace abs_hil::driver::can {

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

}  // namespace abs_hil::driver::can
