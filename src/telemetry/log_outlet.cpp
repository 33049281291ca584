// Appends messages to an LCM event log.
#include "telemetry/log_outlet.hpp"

#include <cmath>
#include <utility>

namespace abs_hil::telemetry {

LogOutlet::LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us, double write_period_s)
    : file_(std::move(path), "event log", write_period_s > 0.0), epoch_us_(epoch_us), write_period_s_(write_period_s) {}

void LogOutlet::send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept {
  const std::int64_t run_time_us = std::llround(time_s * 1e6);
  if (!epoch_us_) epoch_us_ = wall_clock_us() - run_time_us;
  event_.clear();
  append_event(event_, next_number_++, *epoch_us_ + run_time_us, channel, message);
  const bool due = write_period_s_ > 0.0 && time_s - last_write_s_ >= write_period_s_;
  if (due) last_write_s_ = time_s;
  file_.append(event_, due);
}

}  // namespace abs_hil::telemetry
