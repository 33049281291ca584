#include "telemetry/log_outlet.hpp"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <utility>

#include "telemetry/file_error.hpp"
#include "telemetry/wall_clock.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::size_t log_buffer_bytes = 65'536;

}  // namespace

LogOutlet::LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us, double write_period_s)
    : path_(std::move(path)), epoch_us_(epoch_us), write_period_s_(write_period_s) {
  errno = 0;
  file_ = std::make_unique<lcm::LogFile>(path_.string(), "w");
  if (!file_->good()) throw FileError("event log", path_, errno != 0 ? errno : EIO);
  // The default buffer is 4 KiB, which means a write every dozen cycles. It remains if there is no memory for ours.
  (void)std::setvbuf(file_->getFilePtr(), nullptr, _IOFBF, log_buffer_bytes);
}

LogOutlet::~LogOutlet() = default;

void LogOutlet::send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept {
  if (!file_ || error_number_ != 0) {  // after a short write the file has no valid end to append to
    ++failures_;
    return;
  }
  const std::int64_t run_time_us = std::llround(time_s * 1e6);
  if (!epoch_us_) epoch_us_ = wall_clock_us() - run_time_us;
  event_.timestamp = *epoch_us_ + run_time_us;
  event_.channel = channel;
  event_.datalen = static_cast<std::int32_t>(message.size());
  event_.data = const_cast<std::uint8_t*>(message.data());  // LCM only reads it
  errno = 0;
  ++buffered_;
  if (file_->writeEvent(&event_) != 0) {
    note_failure(errno);
  } else if (write_period_s_ > 0.0 && time_s - last_write_s_ >= write_period_s_) {
    write_out(time_s);
  }
}

void LogOutlet::write_out(double time_s) noexcept {
  errno = 0;
  if (std::fflush(file_->getFilePtr()) != 0) {
    note_failure(errno);
  } else {
    buffered_ = 0;
  }
  last_write_s_ = time_s;
}

void LogOutlet::finish() {
  if (file_) {
    // LogFile's destructor flushes too, but does not report errors.
    write_out(last_write_s_);
    file_.reset();
  }
  if (error_number_ != 0) throw FileError("event log", path_, error_number_);
}

void LogOutlet::note_failure(int error_number) noexcept {
  failures_ += std::exchange(buffered_, 0);
  if (error_number_ == 0) error_number_ = error_number != 0 ? error_number : EIO;
}

}  // namespace abs_hil::telemetry
