// One cycle of the driver: send the SYNC, receive the answer, check it.

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "abs_hil/rig/time_units.hpp"
#include "driver/board_kit.hpp"
#include "driver/can/can_driver.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::can {

namespace {

/// Most frames that one cycle reads. An answer has 4.
constexpr int most_frames_in_a_cycle = 64;
/// STATUS and OUTPUTS come with every tenth answer; four of them in a row may be lost.
constexpr int most_answers_without = 50;
/// Largest difference between the node's clock and ours over one interval. The node may answer at any time within the
/// timeout.
constexpr std::int64_t clock_slack_ns = 10'000'000;

/// What a lost cycle is called that an anomaly caused. By number of the anomaly.
struct AnomalyFacts {
  IoError error;
  rig::Reason reason;
};
constexpr std::array<AnomalyFacts, anomaly_count> facts_of{{
    {IoError::no_answer, rig::Reason::can_node_silent},
    {IoError::no_answer, rig::Reason::can_node_silent},
    {IoError::no_answer, rig::Reason::can_send_queue_full},
    {IoError::implausible_answer, rig::Reason::can_frames_stale},
    {IoError::implausible_answer, rig::Reason::can_frames_out_of_order},
    {IoError::implausible_answer, rig::Reason::can_frames_duplicated},
    {IoError::no_answer, rig::Reason::can_too_many_frames},
    {IoError::implausible_answer, rig::Reason::can_values_implausible},
    {IoError::implausible_answer, rig::Reason::can_frames_forged},
    {IoError::incomplete_answer, rig::Reason::can_frame_wrong_length},
}};
static_assert(static_cast<std::size_t>(Anomaly::wrong_length) + 1 == facts_of.size());

const AnomalyFacts& facts(Anomaly anomaly) noexcept { return facts_of[static_cast<std::size_t>(anomaly)]; }

}  // namespace

void CanDriver::note(Anomaly anomaly) noexcept {
  if (anomaly == Anomaly::none) return;
  ++counters_.anomalies[static_cast<std::size_t>(anomaly)];
  worst_ = std::max(worst_, anomaly);
  // A late answer has already been counted as lost.
  if (anomaly != Anomaly::stale) bucket_.lost();
}

IoResult CanDriver::send_sync(std::int64_t now_ns) noexcept {
  ++counters_.cycles;
  tracker_.expect(++sync_);
  worst_ = Anomaly::none;
  worst_id_ = 0;
  if (lock_step_) {
    const IoResult result = sent(link_.socket->send(frame_of(id::time, {.host_time_ns = now_ns})));
    if (!result.ok()) return result;
  }
  sent_ns_ = monotonic_ns();
  return sent(link_.socket->send(in_format(frame_of(id::sync, {.sequence = sync_}))));
}

IoResult CanDriver::take_error_frame(const Frame& frame) noexcept {
  ++counters_.error_frames;
  const BusReport report = bus_report(frame);
  if (report.bus_off) return {IoError::disconnected, frame.id, 0, rig::Reason::can_bus_off};
  if (report.error_passive) return {IoError::no_answer, frame.id, 0, rig::Reason::can_error_passive};
  if (report.error_warning) ++counters_.error_warnings;
  if (report.receive_overflow) note(Anomaly::too_many);
  return {};
}

void CanDriver::take_values(const Decoded& message) noexcept {
  const Values& values = message.values;
  if (message.id != id::outputs) trip_flags_ = static_cast<std::uint32_t>(values.trip_flags);
  if (message.id == id::status) {
    supply_V_ = values.supply_V();
    temperature_C_ = values.temperature_C();
    answers_since_status_ = 0;
    return;
  }
  outputs_known_ = true;
  answers_since_outputs_ = 0;
  applied_ = {.brake = values.brake_duty, .drive = values.drive_duty};
  applied_sequence_ = static_cast<std::uint8_t>(values.command_sequence);
  if (message.id != id::outputs) return;
  // Rejections before the activation do not belong to this run.
  if (any_answer_) counters_.rejected_by_node += static_cast<std::uint8_t>(values.rejected - rejected_seen_);
  rejected_seen_ = values.rejected;
}

void CanDriver::take_message(const Decoded& message) noexcept {
  if (message.id == id::identity) return;
  const bool slow = message.id == id::status || message.id == id::outputs;
  const Anomaly anomaly = slow ? tracker_.place(message.values.sequence) : tracker_.take(message.id, message.values);
  note(anomaly);
  if (anomaly == Anomaly::none && (slow || message.id == id::measurement)) take_values(message);
}

IoResult CanDriver::take(const Frame& frame) noexcept {
  if (frame.error) return take_error_frame(frame);
  if (commands_node(frame)) return {IoError::foreign_writer, frame.id, 0, rig::Reason::foreign_writer};
  const Anomaly before = worst_;
  const Decoded decoded = decode(frame);
  switch (decoded.error) {
    case DecodeError::none:
      take_message(decoded);
      received_ns_ = frame.received_ns;
      break;
    case DecodeError::unknown_identifier: break;
    case DecodeError::wrong_length: note(Anomaly::wrong_length); break;
    case DecodeError::wrong_check: note(Anomaly::forged); break;
    case DecodeError::out_of_range: note(Anomaly::implausible); break;
  }
  if (worst_ != before) worst_id_ = frame.id;
  return {};
}

IoResult CanDriver::collect() noexcept {
  const std::int64_t deadline_ns = sent_ns_ + answer_timeout_ns_;
  Frame frame;
  for (int i = 0; !tracker_.complete(); ++i) {
    if (i == most_frames_in_a_cycle) {
      note(Anomaly::too_many);
      return {};
    }
    const IoResult received = link_.socket->receive(frame, deadline_ns);
    if (received.error == IoError::disconnected) return received;
    if (received.error == IoError::no_answer) return {};
    if (received.error == IoError::incomplete_answer) {
      note(Anomaly::wrong_length);
      continue;
    }
    if (const IoResult result = take(frame); !result.ok()) return result;
  }
  return {};
}

void CanDriver::check_drops() noexcept {
  const std::uint32_t dropped = link_.socket->dropped();
  if (dropped == drops_seen_) return;
  counters_.dropped_by_kernel += dropped - drops_seen_;
  drops_seen_ = dropped;
  note(Anomaly::too_many);
}

IoResult CanDriver::tripped() noexcept {
  // The node is silent: ask whether the interface is down. Bus-off would have come as an error frame.
  if (worst_ <= Anomaly::queue_full && !link_.running()) {
    return {IoError::disconnected, id::sync, 0, rig::Reason::can_interface_down};
  }
  return {facts(worst_).error, worst_id_ != 0 ? worst_id_ : id::sync, 0, facts(worst_).reason};
}

bool CanDriver::advance_counts(const Answer& answer, std::int64_t elapsed_ns) noexcept {
  const std::array<std::uint32_t, 2> raw{static_cast<std::uint32_t>(answer.values.upper_counts),
                                         static_cast<std::uint32_t>(answer.values.lower_counts)};
  const std::array<std::int32_t, 2> signs{options_.upper_sign, options_.lower_sign};
  for (std::size_t wheel = 0; wheel < raw.size(); ++wheel) {
    const std::int32_t moved = travelled(raw_counts_[wheel], raw[wheel], answer.count_bits);
    if (!plausible_travel(0, moved, elapsed_ns, options_)) return false;
    counts_[wheel] = counts_after(counts_[wheel], moved * signs[wheel]);
  }
  raw_counts_ = raw;
  return true;
}

std::int64_t CanDriver::node_interval_ns(const Answer& answer) const noexcept {
  return static_cast<std::uint32_t>(answer.values.node_time_us - node_time_us_) * rig::ns_per_us;
}

std::int64_t CanDriver::latch_time_ns(const Answer& answer, std::int64_t now_ns) const noexcept {
  if (lock_step_) return now_ns;
  const std::int64_t received_ns = std::max(received_ns_, sent_ns_);
  if (!any_answer_) return sent_ns_ + (received_ns - sent_ns_) / 2;
  // The node's clock gives the best interval. The times of SYNC and answer bound the result.
  return std::clamp(latched_ns_ + node_interval_ns(answer), sent_ns_, received_ns);
}

IoResult CanDriver::judge_answer(std::int64_t now_ns) noexcept {
  const Answer& answer = tracker_.answer();
  if (answer.values.state() == NodeState::inactive) {
    return {IoError::implausible_answer, id::latch, 0, rig::Reason::can_node_restarted};
  }
  if (answer.values.state() == NodeState::latched) {
    return {IoError::read_back_mismatch, id::latch, 0, rig::Reason::can_node_latched};
  }
  const std::int64_t time_ns = latch_time_ns(answer, now_ns);
  const std::int64_t interval_ns = any_answer_ ? time_ns - latched_ns_ : 0;
  if (any_answer_ && std::abs(node_interval_ns(answer) - interval_ns) > clock_slack_ns) {
    return {IoError::implausible_answer, id::latch, 0, rig::Reason::can_node_restarted};
  }
  // Bound on the time between activation and first answer.
  constexpr std::int64_t first_interval_ns = 200'000'000;
  if (!advance_counts(answer, any_answer_ ? interval_ns : first_interval_ns)) {
    return {IoError::implausible_answer, id::encoders, 0, rig::Reason::can_values_implausible};
  }
  constexpr std::uint8_t half = 128;
  const auto behind = static_cast<std::uint8_t>(command_sequence_ - applied_sequence_);
  if (outputs_known_ && behind >= half) {  // the node took a command that has not been sent yet
    return {IoError::foreign_writer, id::outputs, 0, rig::Reason::foreign_writer};
  }
  const bool outputs_follow = !outputs_known_ || trip_flags_ != 0 || applied_ == commanded_[applied_sequence_];
  outputs_known_ = false;
  if (!outputs_follow) {
    return {IoError::read_back_mismatch, id::outputs, 0, rig::Reason::can_outputs_not_taken};
  }
  // What is not reported cannot be checked: neither supply, temperature and trips, nor the duties that act.
  if (++answers_since_status_ > most_answers_without) {
    return {IoError::no_answer, id::status, 0, rig::Reason::board_health_lost};
  }
  if (++answers_since_outputs_ > most_answers_without) {
    return {IoError::no_answer, id::outputs, 0, rig::Reason::can_outputs_not_taken};
  }
  node_time_us_ = answer.values.node_time_us;
  latched_ns_ = time_ns;
  any_answer_ = true;
  counters_.longest_answer_ns = std::max(counters_.longest_answer_ns, received_ns_ - sent_ns_);
  return {};
}

IoResult CanDriver::judge(std::int64_t now_ns) noexcept {
  check_drops();
  if (!tracker_.complete()) {
    note(Anomaly::missing);
    return bucket_.tripped() ? tripped() : IoResult{};
  }
  if (const IoResult result = judge_answer(now_ns); !result.ok()) return result;
  if (bucket_.tripped()) return tripped();
  bucket_.good();
  return {};
}

IoResult CanDriver::exchange(std::int64_t now_ns) noexcept {
  if (const IoResult result = send_sync(now_ns); !result.ok()) return result;
  if (const IoResult result = collect(); !result.ok()) return result;
  return judge(now_ns);
}

IoResult CanDriver::do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  if (const IoResult result = exchange(now_ns); !result.ok()) {
    static_cast<void>(send_command({}, false));  // at once, because the caller may react late
    return result;
  }
  measurement = {};
  measurement.time_ns = latched_ns_;
  measurement.upper_counts = counts_[0];
  measurement.lower_counts = counts_[1];
  measurement.supply_V = supply_V_;
  measurement.temperature_C = temperature_C_;
  measurement.trip_flags = trip_flags_;
  return {};
}

}  // namespace abs_hil::driver::can
