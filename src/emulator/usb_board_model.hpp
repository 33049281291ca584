// The emulated RT-DAC/USB2 as a host sees it, and faults of its transfers.

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <string_view>
#include <vector>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// Properties of the emulated RT-DAC/USB2 and its wiring to the rig.
struct UsbBoardOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};  ///< both wheels' speed at power-on, >= 0
  std::uint16_t version{103};     ///< our choice: the real word is not public
  std::uint32_t drive_pwm{0};     ///< PWM channel wired to the drive, 0 ... 9
  std::uint32_t brake_pwm{1};
  std::uint32_t lower_encoder{0};  ///< encoder channel of the lower wheel, 0 ... 7
  std::uint32_t upper_encoder{1};
  std::int32_t enable_line{-1};  ///< digital line that enables the drive, 0 ... 14; -1: none
  bool shows_outputs{true};      ///< frames show the PWM and digital words that were sent; not known of the real board
};

/// The RT-DAC/USB2 with generic logic as a host sees it, frame by frame, and the simulated rig behind it. It was
/// written only from the documented frames and does not use the driver's table. It has no watchdog: without a host the
/// PWMs hold their duties.
class UsbBoardModel final : public RigBehind {
 public:
  static constexpr std::size_t frame_bytes = 504;
  using Image = std::array<std::uint8_t, frame_bytes>;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit UsbBoardModel(const UsbBoardOptions& options);

  /// Kinds of transfers from the host.
  enum class Taken : std::uint8_t { frame, request, nonsense };
  /// Takes a transfer. A frame acts at once. The caller must answer a request with `image`. An invalid transfer, such
  /// as payload with bit 15 set, is counted and changes nothing.
  Taken take(std::span<const std::uint8_t> transfer) noexcept;
  /// The current frame to the host.
  [[nodiscard]] Image image() const noexcept;

  /// Fault: the brake's width ignores writes and shows a value that is 1 too large.
  void break_brake(bool broken) noexcept { brake_broken_ = broken; }

  [[nodiscard]] Outputs outputs() const noexcept override;
  [[nodiscard]] std::uint64_t frames_taken() const noexcept { return frames_taken_; }
  [[nodiscard]] std::uint64_t nonsense() const noexcept { return nonsense_; }

 private:
  static constexpr std::size_t words = frame_bytes / 2;
  [[nodiscard]] double duty(std::uint32_t channel) const noexcept;

  UsbBoardOptions options_;
  std::array<std::uint16_t, words> written_{};  ///< words after the last frame
  std::uint64_t frames_taken_{0};
  std::uint64_t nonsense_{0};
  bool brake_broken_{false};
};

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
