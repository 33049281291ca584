#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Cause of a late cycle: the part that took longest.
enum class OverrunCause : std::uint8_t {
  none = 0,
  wakeup,   ///< the thread woke late: scheduling, interrupts, C-states, firmware
  read,     ///< reading the board's inputs
  control,  ///< estimate, sequence, control, gate
  write,    ///< writing the board's outputs
  record,   ///< statistics and the ring
};
inline constexpr std::size_t overrun_cause_count = 6;

[[nodiscard]] constexpr std::string_view name_of(OverrunCause cause) noexcept {
  constexpr std::array<std::string_view, overrun_cause_count> names{"none",    "wakeup", "read",
                                                                    "control", "write",  "record"};
  const auto index = static_cast<std::size_t>(cause);
  return index < names.size() ? names[index] : "unknown";
}

/// Counts of late cycles since the start of a run. A cycle is late if it has not ended when the next one should begin.
struct OverrunCounts {
  std::uint64_t total{0};
  std::uint64_t startup{0};       ///< late start-up cycles; not part of `total`
  std::uint64_t ticks_missed{0};  ///< whole periods skipped because of the cycles in `total`
  std::uint64_t longest_run{0};   ///< largest number of late cycles in a row
  std::array<std::uint64_t, overrun_cause_count> by_cause{};  ///< adds up to `total`

  [[nodiscard]] std::uint64_t of(OverrunCause cause) const noexcept {
    return by_cause[static_cast<std::size_t>(cause)];
  }
};

}  // namespace abs_hil::rig
