#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace abs_hil::telemetry {

/// Where encoded messages go: the LCM network or a log file. Used from one thread.
class Outlet {
 public:
  Outlet() = default;
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;
  virtual ~Outlet() = default;

  /// Never throws and never gives up the run: a message that cannot be sent is counted. `time_s` is the run time.
  virtual void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept = 0;
  /// No more messages come. Throws FileError when data was lost to a file.
  virtual void finish() {}
  /// Messages that could not be sent or written so far.
  [[nodiscard]] virtual std::uint64_t failures() const noexcept = 0;
};

}  // namespace abs_hil::telemetry
