#include "telemetry/event_csv.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "rig/reason_text.hpp"

namespace abs_hil::telemetry {

namespace {

void append_number(std::string& text, double value) {
  if (std::isnan(value)) {
    text += "NaN";
    return;
  }
  std::array<char, 32> digits{};
  text.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
}

}  // namespace

EventCsv::EventCsv(std::filesystem::path path, rig::RunNames names)
    : file_(std::move(path), "list of events"), text_(event_csv_header), names_(std::move(names)) {
  text_ += '\n';
}

void EventCsv::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  const auto event = detector_.observe(record);
  if (!event) return;
  append_number(text_, record.time_s);
  text_.append(",").append(event->kind).append(",").append(rig::name_of(record.phase));
  // Quoted, because the text of a reason may contain a comma.
  text_.append(",\"").append(event->reason).append("\",");
  append_number(text_, record.reason_value);
  text_.append(",").append(names_.phase_of(record)) += '\n';
}

}  // namespace abs_hil::telemetry
