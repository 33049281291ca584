#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace abs_hil::telemetry {

/// A destination of encoded messages: the LCM network or a log file. Used from one thread.
class Outlet {
 public:
  Outlet() = default;
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;
  virtual ~Outlet() = default;

  /// Sends a message. It never throws: it counts a message that it cannot send. `time_s` is the run time.
  virtual void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept = 0;
  /// Ends the output. Throws files::FileError if data is missing in a file.
  virtual void finish() {}
  /// Messages that could not be sent or written so far.
  [[nodiscard]] virtual std::uint64_t failures() const noexcept = 0;
};

}  // namespace abs_hil::telemetry
