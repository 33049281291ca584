#pragma once

#include <cstdint>

#include "driver/can/messages.hpp"

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
  std::int32_t upper_counts{0};
  std::int32_t lower_counts{0};
  std::int32_t lever_counts{0};
  unsigned count_bits{24};  ///< width of the wheels' counters
  std::uint32_t node_time_us{0};
  NodeState state{NodeState::inactive};
  std::uint8_t sequence{0};
};

/// Assembles the answer to one SYNC from its frames and finds frames that do not belong to it. Real-time safe.
class AnswerTracker {
 public:
  /// Starts anew before the first SYNC; `sequence` is the sequence before it.
  void reset(std::uint8_t sequence) noexcept;
  /// Expects the answer to a SYNC that was sent with this sequence.
  void expect(std::uint8_t sequence) noexcept;

  Anomaly take(const EncodersMessage& encoders) noexcept;
  Anomaly take(const LatchMessage& latch) noexcept;
  Anomaly take(const MeasurementMessage& measurement) noexcept;

  /// `none` if a frame with this sequence belongs to the expected SYNC.
  [[nodiscard]] Anomaly place(std::uint8_t sequence) const noexcept;
  [[nodiscard]] bool complete() const noexcept { return has_encoders_ && has_latch_; }
  /// The answer to the expected SYNC; valid once complete.
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }
  /// Sequence of the last complete answer.
  [[nodiscard]] std::uint8_t last_sequence() const noexcept { return last_; }

 private:
  void note_complete() noexcept;

  std::uint8_t expected_{0};
  std::uint8_t last_{0};
  bool any_{false};  ///< `last_` is the sequence of an answer
  bool has_encoders_{false};
  bool has_latch_{false};
  Answer answer_{};
};

}  // namespace abs_hil::driver::can
