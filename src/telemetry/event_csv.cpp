#include "telemetry/event_csv.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <utility>

#include "rig/reason_text.hpp"
#include "telemetry/file_error.hpp"

namespace abs_hil::telemetry {

namespace {

constexpr std::string_view event_list_kind = "list of events";

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
    : path_(std::move(path)), text_(event_csv_header), names_(std::move(names)) {
  text_ += '\n';
  errno = 0;
  if (!std::ofstream(path_)) throw FileError(event_list_kind, path_, errno);
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

void EventCsv::finish() {
  errno = 0;
  std::ofstream file(path_, std::ios::binary);
  file << text_;
  file.close();
  if (!file) throw FileError(event_list_kind, path_, errno != 0 ? errno : EIO);
}

}  // namespace abs_hil::telemetry
