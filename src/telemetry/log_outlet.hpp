#pragma once

#include <cstdint>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "telemetry/outlet.hpp"

namespace abs_hil::telemetry {

/// Writes an LCM event log, as lcm-logger would, readable by lcm-logplayer and lcm-spy. About 0.4 kB a cycle.
class LogOutlet : public Outlet {
 public:
  /// Creates or empties the file. Event times are `epoch_us` plus run time, us since 1970. Without an epoch it is the
  /// wall clock at the first message less its run time: wall-clock times that keep the spacing of the cycles however
  /// late the ring is emptied. Give an epoch for virtual time: the file is then the same on every run.
  /// Throws FileError when it cannot be opened.
  /// @param write_period_s  messages older than this, by the run time, are handed to the kernel, so that a program that
  ///                        is killed loses no more; 0: only when a block of 64 KiB is full
  explicit LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us = std::nullopt,
                     double write_period_s = 0.0);
  ~LogOutlet() override;

  void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept override;
  /// Throws FileError when any write failed since the start, as on a full disk. Closes the file in any case.
  void finish() override;
  /// Messages that are not in the file, or in part only.
  [[nodiscard]] std::uint64_t failures() const noexcept override { return failures_; }

 private:
  void note_failure(int error_number) noexcept;
  void write_out(double time_s) noexcept;

  std::filesystem::path path_;
  std::optional<std::int64_t> epoch_us_;
  std::unique_ptr<lcm::LogFile> file_;
  lcm::LogEvent event_{};  ///< kept for its channel string, so that writing does not allocate
  double write_period_s_;
  double last_write_s_{0.0};
  std::uint64_t buffered_{0};  ///< at most: those since the last write of ours
  std::uint64_t failures_{0};
  int error_number_{0};  ///< errno of the first write that failed
};

}  // namespace abs_hil::telemetry
