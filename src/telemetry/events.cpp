// Finds phases, faults and changes in the stream of records and writes them.
#include "telemetry/events.hpp"

#include <cmath>

#include "rig/reason_text.hpp"
#include "telemetry/csv_sink.hpp"

namespace abs_hil::telemetry {

std::optional<DetectedEvent> EventDetector::observe(const rig::CycleRecord& record) {
  const bool first = !last_;
  // An experiment may have two phases of one kind in a row.
  const bool phase_changed = first || record.phase != last_->phase || record.phase_index != last_->phase_index;
  // The answer to a command reports its change.
  const bool reason_is_new = record.reason != rig::Reason::none && !rig::is_adjustment(record.reason) &&
                             (first || record.reason != last_->reason);
  const std::uint64_t records_lost = first ? record.sequence : record.sequence - last_->sequence - 1;
  last_ = Seen{record.sequence, record.phase, record.phase_index, record.reason};
  if (!phase_changed && !reason_is_new) return std::nullopt;

  DetectedEvent event;
  event.reason = rig::reason_text(record.reason, record.reason_value, names_.signals);
  if (rig::is_fault(record.reason) || (phase_changed && record.phase == rig::Phase::fault)) {
    event.kind = event_kind::fault;
  } else {
    event.kind = phase_changed ? event_kind::phase : event_kind::limit;
  }
  if (phase_changed) {
    if (!first) event.message.append(phase_name_).append(" -> ");
    phase_name_ = names_.phase_of(record);
  }
  event.message.append(phase_name_);
  if (record.reason != rig::Reason::none) {
    event.message.append(": ").append(rig::is_fault(record.reason)
                                          ? rig::reason_with_value(record.reason, record.reason_value, names_.signals)
                                          : event.reason);
  }
  // The change and its reason may be in a lost record.
  if (records_lost > 0) event.message.append(" (").append(std::to_string(records_lost)).append(" records lost before)");
  return event;
}

EventCsv::EventCsv(std::filesystem::path path, rig::RunNames names)
    : file_(std::move(path), "list of events"), text_(event_csv_header), names_(std::move(names)) {
  text_ += '\n';
}

void EventCsv::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  const auto event = detector_.observe(record);
  if (!event) return;
  text_ += csv_number(std::round(record.time_s * 1e6) / 1e6);  // in us, without the rounding of its arithmetic
  text_.append(",").append(event->kind).append(",").append(rig::name_of(record.phase));
  // Quoted, because the text of a reason may contain a comma.
  text_.append(",\"").append(event->reason).append("\",");
  text_ += csv_number(record.reason_value);
  text_.append(",").append(names_.phase_of(record)) += '\n';
}

}  // namespace abs_hil::telemetry
