#pragma once

#include <chrono>
#include <cstdint>

namespace abs_hil::telemetry {

/// Time since 1970 in us, as in LCM's stamps.
[[nodiscard]] inline std::int64_t wall_clock_us() {
  using std::chrono::duration_cast, std::chrono::microseconds, std::chrono::system_clock;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

}  // namespace abs_hil::telemetry
