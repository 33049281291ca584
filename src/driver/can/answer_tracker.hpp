#pragma once

#include <cstdint>

#include "driver/can/messages.hpp"

namespace abs_hil::driver::can {

/// What is wrong with a frame or a cycle. The larger number is the more telling one.
enum class Anomaly : std::uint8_t {
  none = 0,
  missing,       ///< no answer in time
  queue_full,    ///< the SYNC or the command could not be sent
  stale,         ///< an answer to an earlier SYNC
  out_of_order,  ///< ahead of the SYNC, or its two frames the wrong way round
  duplicate,     ///< the same frame again
  too_many,      ///< more frames than one cycle reads, or the kernel dropped some
  implausible,   ///< a signal out of its range
  forged,        ///< the node's identifier with a wrong check
  wrong_length,
};

/// Where a node's counters stood at one SYNC, as the node says it.
struct Answer {
  std::int32_t upper_counts{0};
  std::int32_t lower_counts{0};
  std::int32_t lever_counts{0};
  unsigned count_bits{24};  ///< of the wheels' counters
  std::uint32_t node_time_us{0};
  NodeState state{NodeState::inactive};
  std::uint8_t sequence{0};
};

/// Puts the answer to one SYNC together from its frames and tells what does not belong to it. Real-time safe.
class AnswerTracker {
 public:
  /// Before the first SYNC; `sequence` is the one before it.
  void reset(std::uint8_t sequence) noexcept;
  /// A SYNC with this sequence has been sent.
  void expect(std::uint8_t sequence) noexcept;

  Anomaly take(const EncodersMessage& encoders) noexcept;
  Anomaly take(const LatchMessage& latch) noexcept;
  Anomaly take(const MeasurementMessage& measurement) noexcept;

  /// `none` if a frame with this sequence belongs to the SYNC expected.
  [[nodiscard]] Anomaly place(std::uint8_t sequence) const noexcept;
  [[nodiscard]] bool complete() const noexcept { return has_encoders_ && has_latch_; }
  /// The answer to the SYNC expected, once complete.
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }
  /// Sequence of the last complete answer.
  [[nodiscard]] std::uint8_t last_sequence() const noexcept { return last_; }

 private:
  void note_complete() noexcept;

  std::uint8_t expected_{0};
  std::uint8_t last_{0};
  bool any_{false};  ///< `last_` is that of an answer
  bool has_encoders_{false};
  bool has_latch_{false};
  Answer answer_{};
};

}  // namespace abs_hil::driver::can
