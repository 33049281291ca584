// Appends messages to an LCM event log.
#include "telemetry/log_outlet.hpp"

#include <cerrno>
#include <cmath>
#include <utility>

namespace abs_hil::telemetry {
LogOutlet::LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us, double write_period_s)
    : log_(std::in_place, path), path_(std::move(path)), epoch_us_(epoch_us), write_period_s_(write_period_s) {}

LogOutlet::~LogOutlet() {
  // An error ended the run: what was recorded stays. A failure is not reported then.
  if (next_number_ == 0) return;
  try {
    LogOutlet::finish();
  } catch (const files::FileError&) {
  }
}

void LogOutlet::send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept {
  if (!log_ || error_number_ != 0) {  // after a short write the file has no valid end to append to
    ++failures_;
    return;
  }
  const std::int64_t run_time_us = std::llround(time_s * 1e6);
  if (!epoch_us_) epoch_us_ = wall_clock_us() - run_time_us;
  ++buffered_;
  try {
    log_->write(next_number_++, *epoch_us_ + run_time_us, channel, message);
    if (write_period_s_ > 0.0 && time_s - last_write_s_ >= write_period_s_) {
      last_write_s_ = time_s;
      log_->file().flush();
      log_->file().show();
      buffered_ = 0;
    }
  } catch (const files::FileError& error) {
    note_failure(error.error_number());
  }
}

void LogOutlet::finish() {
  if (log_ && error_number_ == 0) {
    try {
      log_->finish();
    } catch (const files::FileError& error) {
      note_failure(error.error_number());
    }
  }
  log_.reset();
  if (error_number_ != 0) throw files::FileError("event log", path_, error_number_);
}

void LogOutlet::note_failure(int error_number) noexcept {
  failures_ += std::exchange(buffered_, 0);
  if (error_number_ == 0) error_number_ = error_number != 0 ? error_number : EIO;
}

}  // namespace abs_hil::telemetry
