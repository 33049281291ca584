#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "telemetry/event_log.hpp"
#include "telemetry/outlet.hpp"
#include "telemetry/record_file.hpp"

namespace abs_hil::telemetry {

/// Time since 1970 in us, as in LCM's stamps.
[[nodiscard]] inline std::int64_t wall_clock_us() {
  using std::chrono::duration_cast, std::chrono::microseconds, std::chrono::system_clock;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

/// Writes an LCM event log as lcm-logger does (RecordFile). lcm-logplayer and lcm-spy can read it. Each cycle takes
/// about 0.4 kB.
class LogOutlet : public Outlet {
 public:
  /// Event times are `epoch_us` plus run time, us since 1970. Without an epoch it is the
  /// wall clock at the first message minus its run time. So the times keep the spacing of the cycles, however late the
  /// ring is emptied. Give an epoch for virtual time: then every run gives the same file.
  /// Throws files::FileError when the file cannot be opened.
  /// @param write_period_s  longest run time until a message is written, so that a killed program loses no older
  ///                        messages; the first of these writes replaces an older file. 0: messages are written when a
  ///                        block of 64 KiB is full, and the file appears when it is whole
  explicit LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us = std::nullopt,
                     double write_period_s = 0.0)
      : file_(std::move(path), "event log", write_period_s > 0.0),
        epoch_us_(epoch_us),
        write_period_s_(write_period_s) {}

  void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept override {
    const std::int64_t run_time_us = std::llround(time_s * 1e6);
    if (!epoch_us_) epoch_us_ = wall_clock_us() - run_time_us;
    event_.clear();
    append_event(event_, next_number_++, *epoch_us_ + run_time_us, channel, message);
    const bool due = write_period_s_ > 0.0 && time_s - last_write_s_ >= write_period_s_;
    if (due) last_write_s_ = time_s;
    file_.append(event_, due);
  }
  void finish() override { file_.finish(); }
  [[nodiscard]] std::uint64_t failures() const noexcept override { return file_.lost(); }

 private:
  RecordFile file_;
  std::string event_{};  ///< the latest, in the file's form
  std::optional<std::int64_t> epoch_us_;
  std::int64_t next_number_{0};
  double write_period_s_;
  double last_write_s_{0.0};
};

}  // namespace abs_hil::telemetry
