#include "driver/can/answer_tracker.hpp"

namespace abs_hil::driver::can {

void AnswerTracker::reset(std::uint8_t sequence) noexcept {
  *this = {};
  expected_ = last_ = sequence;
}

void AnswerTracker::expect(std::uint8_t sequence) noexcept {
  expected_ = sequence;
  has_encoders_ = has_latch_ = false;
  answer_ = {};
  answer_.sequence = sequence;
}

Anomaly AnswerTracker::place(std::uint8_t sequence) const noexcept {
  const auto behind = static_cast<std::uint8_t>(expected_ - sequence);
  constexpr std::uint8_t half = 128;
  if (behind == 0) return Anomaly::none;
  if (behind >= half) return Anomaly::out_of_order;
  return any_ && sequence == last_ ? Anomaly::duplicate : Anomaly::stale;
}

void AnswerTracker::note_complete() noexcept {
  if (!complete()) return;
  last_ = expected_;
  any_ = true;
}

Anomaly AnswerTracker::take(const EncodersMessage& encoders) noexcept {
  if (const Anomaly anomaly = place(encoders.sequence); anomaly != Anomaly::none) return anomaly;
  if (has_encoders_) return Anomaly::duplicate;
  // The latch should have come last. The answer is still valid.
  const Anomaly anomaly = has_latch_ ? Anomaly::out_of_order : Anomaly::none;
  answer_.upper_counts = encoders.upper_counts;
  answer_.lower_counts = encoders.lower_counts;
  answer_.count_bits = signal::upper_counts.bits;
  has_encoders_ = true;
  note_complete();
  return anomaly;
}

Anomaly AnswerTracker::take(const LatchMessage& latch) noexcept {
  if (const Anomaly anomaly = place(latch.sequence); anomaly != Anomaly::none) return anomaly;
  if (has_latch_) return Anomaly::duplicate;
  answer_.lever_counts = latch.lever_counts;
  answer_.node_time_us = latch.node_time_us;
  answer_.state = latch.state;
  has_latch_ = true;
  note_complete();
  return Anomaly::none;
}

Anomaly AnswerTracker::take(const MeasurementMessage& measurement) noexcept {
  if (const Anomaly anomaly = place(measurement.sequence); anomaly != Anomaly::none) return anomaly;
  if (has_encoders_ || has_latch_) return Anomaly::duplicate;
  answer_.upper_counts = measurement.upper_counts;
  answer_.lower_counts = measurement.lower_counts;
  answer_.lever_counts = measurement.lever_counts;
  answer_.count_bits = signal::fd_upper_counts.bits;
  answer_.node_time_us = measurement.node_time_us;
  answer_.state = measurement.state;
  has_encoders_ = has_latch_ = true;
  note_complete();
  return Anomaly::none;
}

}  // namespace abs_hil::driver::can
