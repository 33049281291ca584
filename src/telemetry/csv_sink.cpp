// A row of the run's CSV each cycle.
#include "telemetry/csv_sink.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include "abs_hil/rig/quantities.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::size_t block_bytes = 65'536;
constexpr std::string_view csv_kind = "CSV file";

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

CsvSink::CsvSink(std::filesystem::path path, std::int64_t write_period_ns, rig::RunNames names)
    : file_(std::in_place, path, std::string(csv_kind)),
      path_(std::move(path)),
      buffer_(block_bytes),
      write_period_ns_(write_period_ns),
      names_(std::move(names)) {
  append(csv_header.data(), csv_header.size());
  if (names_.has_own_phase_names()) {
    append(",", 1);
    append(phase_name_column.data(), phase_name_column.size());
  }
  for (const std::string& signal : names_.signals) {
    append(",", 1);
    append(signal.data(), signal.size());
  }
  append("\n", 1);
}

CsvSink::~CsvSink() {
  // An error ended the run: what was recorded stays. Without a single row an older file stays.
  if (rows_ > 0) close();
}

void CsvSink::consume(const rig::CycleRecord& record, double distance_m) {
  char row[csv_row_max_bytes];
  append(row, format_csv_row(record, distance_m, row, names_));
  ++rows_buffered_;
  ++rows_;
  if (write_period_ns_ > 0 && record.stamp_ns - last_write_ns_ >= write_period_ns_) {
    flush();
    last_write_ns_ = record.stamp_ns;
  }
}

void CsvSink::finish() {
  close();
  if (failed()) throw files::FileError(csv_kind, path_, error_number_);
}

void CsvSink::append(const char* text, std::size_t size) noexcept {
  if (size > buffer_.size() - used_bytes_) flush();  // whole rows only, so that no block ends with a part of a row
  std::memcpy(buffer_.data() + used_bytes_, text, size);
  used_bytes_ += size;
}

void CsvSink::flush() noexcept {
  // No retry after a failure: a file that ends early is better than a file with a gap.
  if (!failed() && file_) {
    try {
      file_->append({buffer_.data(), used_bytes_});
      file_->flush();
      if (write_period_ns_ > 0) file_->show();
    } catch (const files::FileError& error) {
      error_number_ = error.error_number();
    }
  }
  if (failed()) rows_lost_ += rows_buffered_;
  rows_buffered_ = 0;
  used_bytes_ = 0;
}

void CsvSink::close() noexcept {
  flush();
  try {
    if (file_ && !failed()) file_->commit();
  } catch (const files::FileError& error) {
    error_number_ = error.error_number();
  }
  file_.reset();
  if (failed() && write_period_ns_ == 0) rows_lost_ = rows_;  // a file that is not whole does not appear
}

}  // namespace abs_hil::telemetry
