#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// The longest part of a late cycle, which is the probable cause.
enum class OverrunCause : std::uint8_t {
  none = 0,
  wakeup,   ///< the kernel let the thread run late: scheduling, interrupts, C-states, firmware
  read,     ///< the board's inputs
  control,  ///< estimate, sequence, control, gate
  write,    ///< the board's outputs
  record,   ///< statistics and the ring
};
inline constexpr std::size_t overrun_cause_count = 6;

[[nodiscard]] constexpr std::string_view name_of(OverrunCause cause) noexcept {
  constexpr std::array<std::string_view, overrun_cause_count> names{"none",    "wakeup", "read",
                                                                    "control", "write",  "record"};
  const auto index = static_cast<std::size_t>(cause);
  return index < names.size() ? names[index] : "unknown";
}

/// Late cycles since the start of a run. A cycle is late if it has not ended when the next one should begin.
struct OverrunCounts {
  std::uint64_t total{0};
  std::uint64_t startup{0};                                   ///< during the start-up cycles; not included in `total`
  std::uint64_t ticks_missed{0};                              ///< whole periods that the late cycles of `total` skipped
  std::uint64_t longest_run{0};                               ///< largest number of consecutive late cycles
  std::array<std::uint64_t, overrun_cause_count> by_cause{};  ///< the sum is `total`

  [[nodiscard]] std::uint64_t of(OverrunCause cause) const noexcept {
    return by_cause[static_cast<std::size_t>(cause)];
  }
};

}  // namespace abs_hil::rig
