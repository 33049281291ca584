#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

namespace abs_hil::emulator {

/// What can be wrong with a USB board's transfers. `set` takes the words of `--fault`.
struct UsbFaults {
  enum class Stall : std::uint8_t { none, once, on };  ///< `once`: until the host clears it
  Stall stall_in{Stall::none};
  Stall stall_out{Stall::none};
  std::optional<std::size_t> length{};  ///< of every answer, in bytes, instead of a frame's
  bool silent{false};                   ///< requests are taken and never answered
  std::int64_t late_ns{0};              ///< every answer comes so much later
  std::uint32_t late_count{0};          ///< so many answers more come late; 0: as long as `late_ns` says
  bool garbage{false};                  ///< every answer is random bytes

  /// "ok", "stall in", "stall out once", "length 100", "silent", "late 3000" (us), "late 3000 4" (so many), "garbage".
  /// Throws std::invalid_argument, saying what is valid.
  void set(std::string_view text);
  /// One answer as the host gets it.
  void spoil(std::vector<std::uint8_t>& answer, std::mt19937_64& random) const;
};

}  // namespace abs_hil::emulator
