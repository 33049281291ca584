#pragma once

#include <cstdint>

#include "abs_hil/driver/io_result.hpp"

namespace abs_hil::driver {

/// The clock of an emulated board in lock-step: it advances only when the driver says so. No hardware has such a clock.
class EmulatedTime {
 public:
  EmulatedTime() = default;
  EmulatedTime(const EmulatedTime&) = delete;
  EmulatedTime& operator=(const EmulatedTime&) = delete;
  virtual ~EmulatedTime() = default;

  virtual IoResult now(std::int64_t& time_ns) noexcept = 0;
  /// Advances the emulated rig to `time_ns` and returns when that is done.
  virtual IoResult advance_to(std::int64_t time_ns) noexcept = 0;
};

}  // namespace abs_hil::driver
