#include "telemetry/csv_sink.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

#include "telemetry/file_error.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::size_t block_bytes = 65'536;
constexpr std::string_view csv_kind = "CSV file";

/// Appends to a row that is known to be large enough.
class RowWriter {
 public:
  explicit RowWriter(char (&out)[csv_row_max_bytes]) : begin_(out), at_(out), end_(out + csv_row_max_bytes) {}

  RowWriter& number(double value) {
    if (std::isnan(value)) return text("NaN");  // to_chars would show the sign of a NaN
    at_ = std::to_chars(at_, end_, value).ptr;
    return *this;
  }
  RowWriter& text(std::string_view value) {
    at_ = std::copy(value.begin(), value.end(), at_);
    return *this;
  }
  RowWriter& next(double value) {
    *at_++ = ',';
    return number(value);
  }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(at_ - begin_); }

 private:
  char* begin_;
  char* at_;
  char* end_;
};

}  // namespace

std::size_t format_csv_row(const rig::CycleRecord& record, double distance_m, char (&out)[csv_row_max_bytes]) noexcept {
  const auto& truth = record.truth;
  const auto& control = record.control;
  RowWriter row(out);
  row.number(record.time_s).text(",").text(rig::name_of(record.phase));
  row.next(truth.speeds.omega1_rad_s).next(truth.speeds.omega2_rad_s);
  row.next(control.speeds_est.omega1_rad_s).next(control.speeds_est.omega2_rad_s);
  row.next(truth.slip).next(control.slip_est).next(control.slip_ref);
  row.next(truth.brake_torque_Nm).next(control.brake_torque_ref_Nm).next(control.brake_torque_est_Nm);
  row.next(record.command.brake_duty).next(record.command.motor_duty);
  row.text(record.command.motor_enable ? ",1" : ",0");
  row.next(truth.theta_N).next(control.theta_est_N).next(distance_m).next(control.slip_velocity_error_m_s);
  row.text("\n");
  return row.size();
}

CsvSink::CsvSink(std::filesystem::path path, std::int64_t write_period_ns)
    : path_(std::move(path)), buffer_(block_bytes), write_period_ns_(write_period_ns) {
  do {
    file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  } while (file_ < 0 && errno == EINTR);
  if (file_ < 0) throw FileError(csv_kind, path_, errno);
  append(csv_header.data(), csv_header.size());
  append("\n", 1);
}

CsvSink::~CsvSink() { close(); }

void CsvSink::consume(const rig::CycleRecord& record, double distance_m) {
  char row[csv_row_max_bytes];
  append(row, format_csv_row(record, distance_m, row));
  ++rows_buffered_;
  if (write_period_ns_ > 0 && record.stamp_ns - last_write_ns_ >= write_period_ns_) {
    flush();
    last_write_ns_ = record.stamp_ns;
  }
}

void CsvSink::finish() {
  close();
  if (failed()) throw FileError(csv_kind, path_, error_number_);
}

void CsvSink::append(const char* text, std::size_t size) noexcept {
  if (size > buffer_.size() - used_bytes_) flush();  // whole rows only: no reader finds half of one at a block's end
  std::memcpy(buffer_.data() + used_bytes_, text, size);
  used_bytes_ += size;
}

void CsvSink::flush() noexcept {
  std::size_t written_bytes = 0;
  while (!failed() && file_ >= 0 && written_bytes < used_bytes_) {
    const ssize_t n = ::write(file_, buffer_.data() + written_bytes, used_bytes_ - written_bytes);
    if (n > 0) {
      written_bytes += static_cast<std::size_t>(n);
    } else if (n == 0 || errno != EINTR) {
      // No retry: a file with a hole in the middle would be worse than one that ends early.
      error_number_ = n == 0 ? EIO : errno;
    }
  }
  if (failed()) rows_lost_ += rows_buffered_;
  rows_buffered_ = 0;
  used_bytes_ = 0;
}

void CsvSink::close() noexcept {
  flush();
  // Some file systems (NFS, quotas) tell only now that data was lost.
  if (file_ >= 0 && ::close(file_) != 0 && errno != EINTR && !failed()) error_number_ = errno;
  file_ = -1;
}

}  // namespace abs_hil::telemetry
