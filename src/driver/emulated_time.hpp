#pragma once

#include <cstdint>

#include "abs_hil/driver/io_result.hpp"

namespace abs_hil::driver {

/// The clock of an emulated board in lock-step: it stands still until told to go on. No hardware has one.
class EmulatedTime {
 public:
  EmulatedTime() = default;
  EmulatedTime(const EmulatedTime&) = delete;
  EmulatedTime& operator=(const EmulatedTime&) = delete;
  virtual ~EmulatedTime() = default;

  virtual IoResult now(std::int64_t& time_ns) noexcept = 0;
  /// Lets the emulated rig go on to `time_ns`; returns when it is there.
  virtual IoResult advance_to(std::int64_t time_ns) noexcept = 0;
};

}  // namespace abs_hil::driver
