#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

namespace abs_hil::emulator {

/// Faults of a USB board's transfers. `set` takes the text of `--fault`.
struct UsbFaults {
  enum class Stall : std::uint8_t { none, once, on };  ///< `once`: until the host clears it
  Stall stall_in{Stall::none};
  Stall stall_out{Stall::none};
  std::optional<std::size_t> length{};  ///< length of every answer in bytes, instead of a frame's
  bool silent{false};                   ///< requests are accepted but never answered
  std::int64_t late_ns{0};              ///< delay of every answer
  std::uint32_t late_count{0};          ///< number of answers still to be delayed; 0: every answer
  bool garbage{false};                  ///< every answer is random bytes

  /// Sets a fault: "ok", "stall in", "stall out once", "length 100", "silent", "late 3000" (us), "late 3000 4" (us,
  /// number of answers), "garbage". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  /// The answer that the host receives.
  void spoil(std::vector<std::uint8_t>& answer, std::mt19937_64& random) const;
};

}  // namespace abs_hil::emulator
