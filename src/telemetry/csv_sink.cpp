// A row of the run's CSV each cycle. Finds phases, faults and changes in the stream of records and writes them.
#include "telemetry/csv_sink.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>
#include <utility>

#include "abs_hil/rig/quantities.hpp"
#include "rig/reason_text.hpp"

namespace abs_hil::telemetry {

namespace {
// The longest double is -1.2345678901234567e-308, the longest whole number has a sign and 19 digits.
constexpr std::size_t longest_value = 24;
static_assert((rig::csv_columns.size() + rig::signal_max) * (longest_value + 1) + rig::phase_name_max + 1 <=
                  csv_row_max_bytes,
              "the rows need more room");

char* put_text(char* at, std::string_view text) noexcept { return std::copy(text.begin(), text.end(), at); }
template <class Value>
char* put(char* at, const Value& value) noexcept {
  if constexpr (std::is_same_v<Value, rig::Phase>) {
    return put_text(at, rig::name_of(value));
  } else if constexpr (std::is_floating_point_v<Value>) {
    if (std::isnan(value)) return put_text(at, "NaN");  // to_chars would show the sign of a NaN
    return std::to_chars(at, at + longest_value, value).ptr;
  } else {
    return std::to_chars(at, at + longest_value, static_cast<std::int64_t>(value)).ptr;
  }
}

}  // namespace

const std::string csv_header = fmt::format("{}", fmt::join(rig::csv_columns, ","));

std::size_t format_csv_row(const rig::CycleRecord& record, double distance_m, char (&out)[csv_row_max_bytes],
                           const rig::RunNames& names) noexcept {
  constexpr std::int64_t no_message = 0;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, no_message};
  char* at = out;
  rig::for_each_quantity([&](const auto& row) {
    if (!row.in_csv()) return;
    if (at != out) *at++ = ',';
    at = put(at, row.at(parts));
  });
  if (names.has_own_phase_names()) {
    *at++ = ',';
    at = put_text(at, names.phase_of(record).substr(0, rig::phase_name_max));
  }
  for (std::size_t n = 0; n < std::min(names.signals.size(), rig::signal_max); ++n) {
    *at++ = ',';
    at = put(at, record.control.signals[n]);
  }
  *at++ = '\n';
  return static_cast<std::size_t>(at - out);
}

std::string csv_number(double value) {
  char digits[longest_value];
  return {digits, put(digits, value)};
}

CsvSink::CsvSink(std::filesystem::path path, std::int64_t write_period_ns, rig::RunNames names)
    : file_(std::move(path), "CSV file", write_period_ns > 0),
      write_period_ns_(write_period_ns),
      names_(std::move(names)) {
  std::string header = csv_header;
  if (names_.has_own_phase_names()) header.append(",").append(phase_name_column);
  for (const std::string& signal : names_.signals) header.append(",").append(signal);
  file_.begin(header + '\n');
}

void CsvSink::consume(const rig::CycleRecord& record, double distance_m) {
  char row[csv_row_max_bytes];
  const std::size_t size = format_csv_row(record, distance_m, row, names_);
  const bool due = write_period_ns_ > 0 && record.stamp_ns - last_write_ns_ >= write_period_ns_;
  if (due) last_write_ns_ = record.stamp_ns;
  file_.append({row, size}, due);
}

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
