#pragma once

#include <cstdint>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::driver {

/// CLOCK_MONOTONIC in ns. Real-time safe: no system call (vDSO).
[[nodiscard]] inline std::int64_t monotonic_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * rig::ns_per_s + now.tv_nsec;
}

}  // namespace abs_hil::driver
