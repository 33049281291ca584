// The emulated RT-DAC/USB2 as a host sees it, and faults of its transfers.

#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// The RT-DAC/USB2 with generic logic as a host sees it, frame by frame, and the simulated rig behind it. It was
/// written only from the documented frames and does not use the driver's table. It has no watchdog: without a host the
/// PWMs hold their duties.
class UsbBoardModel final : public RigBehind {
 public:
  static constexpr std::size_t frame_bytes = 504;
  using Image = std::array<std::uint8_t, frame_bytes>;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit UsbBoardModel(const BoardOptions& options) : RigBehind(options) {
    check_channels("PWM", options.drive_pwm, options.brake_pwm, 10);
    check_channels("encoder", options.lower_encoder, options.upper_encoder, 8);
    if (options.enable_line > 14) {
      throw std::invalid_argument("enable line " + std::to_string(options.enable_line) + ": give -1 to 14");
    }
    written_[12] = written_[13] = 0x7FFF;  // all lines are inputs at power-on
  }

  /// Kinds of transfers from the host.
  enum class Taken : std::uint8_t { frame, request, nonsense };
  /// Takes a transfer. A frame acts at once. The caller must answer a request with `image`. An invalid transfer, such
  /// as payload with bit 15 set, is counted and changes nothing.
  Taken take(std::span<const std::uint8_t> transfer) noexcept {
    const auto nonsense = [this] {
      ++nonsense_;
      return Taken::nonsense;
    };
    if (transfer.size() == 4 && transfer[0] == 0xFF && transfer[1] == 0x8F && transfer[2] == 0 && transfer[3] == 0) {
      return Taken::request;
    }
    if (transfer.size() != frame_bytes || transfer[0] != 0x0F || transfer[1] != 0x8F) return nonsense();
    for (std::size_t high_byte = 3; high_byte < frame_bytes; high_byte += 2) {
      if (transfer[high_byte] > 0x7F) return nonsense();
    }
    ++frames_taken_;
    for (std::size_t word = 1; word < words; ++word) {
      if (!host_sets(word)) continue;
      written_[word] = static_cast<std::uint16_t>(transfer[2 * word] + 256U * transfer[2 * word + 1]);
    }
    if (brake_broken_) ++written_[22 + 3 * options_.brake_pwm];
    return Taken::frame;
  }
  /// The current frame to the host.
  [[nodiscard]] Image image() const noexcept {
    std::array<std::uint16_t, words> shown{};
    // "ABSEMU", the date as two words, and the channel counts. This project chose all of these values.
    const std::array<std::uint16_t, 9> identity{options_.version, 0x4241, 0x4553, 0x554D, 0x2026,
                                                0x1121,           0x0A08, 0x0004, 0x1004};
    std::copy(identity.begin(), identity.end(), shown.begin());
    if (options_.shows_outputs) {
      for (std::size_t word = 10; word < words; ++word) shown[word] = written_[word];
    }
    for (const bool upper : {true, false}) {
      const std::uint32_t channel = upper ? options_.upper_encoder : options_.lower_encoder;
      const auto counts = static_cast<std::uint32_t>(position(upper));
      shown[53 + 2 * channel] = static_cast<std::uint16_t>(counts & 0xFFFFU);
      shown[54 + 2 * channel] = static_cast<std::uint16_t>(counts >> 16U);
    }
    Image image{};
    for (std::size_t word = 0; word < words; ++word) {
      image[2 * word] = static_cast<std::uint8_t>(shown[word] % 256U);
      image[2 * word + 1] = static_cast<std::uint8_t>(shown[word] / 256U);
    }
    return image;
  }

  /// Fault: the brake's width ignores writes and shows a value that is 1 too large.
  void break_brake(bool broken) noexcept { brake_broken_ = broken; }

  [[nodiscard]] Outputs outputs() const noexcept override {
    bool enabled = !emergency_stop();
    if (options_.enable_line >= 0) {
      const std::uint32_t line = 1U << static_cast<std::uint32_t>(options_.enable_line);
      enabled = enabled && (written_[12] & line) == 0 && (written_[14] & line) != 0;
    }
    return {.drive_duty = enabled ? duty(options_.drive_pwm) : 0.0, .brake_duty = duty(options_.brake_pwm)};
  }
  [[nodiscard]] std::uint64_t frames_taken() const noexcept { return frames_taken_; }
  [[nodiscard]] std::uint64_t nonsense() const noexcept { return nonsense_; }

 private:
  /// Words that the host sets: digital mode, direction and out; PWM; encoder set-up; timers; ADC gain; DAC.
  static constexpr bool host_sets(std::size_t word) noexcept {
    return (word >= 10 && word <= 15) || (word >= 20 && word <= 52) || (word >= 70 && word <= 75) ||
           (word >= 200 && word <= 203) || (word >= 220 && word <= 223);
  }

  static void check_channels(const char* what, std::uint32_t a, std::uint32_t b, std::uint32_t count) {
    if (a < count && b < count && a != b) return;
    throw std::invalid_argument(std::string(what) + " channels " + std::to_string(a) + " and " + std::to_string(b) +
                                ": give two different ones below " + std::to_string(count));
  }

  static constexpr std::size_t words = frame_bytes / 2;
  [[nodiscard]] double duty(std::uint32_t channel) const noexcept {
    const bool twelve_bits = (written_[21 + 3 * channel] & 2U) != 0;
    const std::uint32_t full = twelve_bits ? 4095 : 255;
    return static_cast<double>(std::min<std::uint32_t>(written_[22 + 3 * channel], full)) / static_cast<double>(full);
  }

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
  void set(std::string_view text) {
    std::vector<std::string_view> words = rig::split(text, ' ');
    std::erase(words, "");
    const auto is = [&words](std::string_view name, std::size_t least, std::size_t most) {
      return !words.empty() && words[0] == name && words.size() > least && words.size() <= most + 1;
    };
    constexpr std::int64_t longest_answer = 512;
    constexpr std::int64_t latest_us = 10'000'000;
    if (is("ok", 0, 0)) {
      *this = {};
    } else if (is("stall", 1, 2) && (words[1] == "in" || words[1] == "out") &&
               (words.size() == 2 || words[2] == "once")) {
      (words[1] == "in" ? stall_in : stall_out) = words.size() == 3 ? Stall::once : Stall::on;
    } else if (is("length", 1, 1)) {
      length = static_cast<std::size_t>(at_most(longest_answer, words[1], text));
    } else if (is("silent", 0, 0)) {
      silent = true;
    } else if (is("late", 1, 2)) {
      late_ns = at_most(latest_us, words[1], text) * 1000;
      late_count = words.size() == 3 ? static_cast<std::uint32_t>(at_most(latest_us, words[2], text)) : 0;
    } else if (is("garbage", 0, 0)) {
      garbage = true;
    } else {
      refuse_fault(text, valid_usb_fault);
    }
  }
  /// The answer that the host receives.
  void spoil(std::vector<std::uint8_t>& answer, std::mt19937_64& random) const {
    if (garbage) {
      for (std::uint8_t& byte : answer) byte = static_cast<std::uint8_t>(random() >> 56U);
    }
    if (length) answer.resize(*length);
  }

 private:
  static constexpr std::string_view valid_usb_fault =
      "ok, stall in|out [once], length BYTES (0 to 512), silent, late US [COUNT], or garbage";

  static std::int64_t at_most(std::int64_t most, std::string_view word, std::string_view whole) {
    const auto value = rig::parse_number<std::int64_t>(word);
    if (!value || *value < 0 || *value > most) refuse_fault(whole, valid_usb_fault);
    return *value;
  }
};

}  // namespace abs_hil::emulator
