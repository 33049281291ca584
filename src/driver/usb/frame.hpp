#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/driver/standing.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::driver::usb {

// Frames of the RT-DAC/USB2 with generic logic 1.03, from the maker's driver sources. Nothing here has been tried on
// hardware.

inline constexpr std::size_t frame_bytes = 504;
inline constexpr std::size_t frame_words = frame_bytes / 2;  ///< 16 bits each, low byte first

/// 504 bytes, either way.
using Frame = std::array<std::uint8_t, frame_bytes>;

/// Asks for one frame.
inline constexpr std::array<std::uint8_t, 4> frame_request{0xFF, 0x8F, 0x00, 0x00};
/// First word of a frame to the board: bytes 0F 8F. Only such words have bit 15 set: payload has 15 bits a word.
inline constexpr std::uint16_t write_mark = 0x8F0F;
inline constexpr std::uint16_t payload_bits = 0x7FFF;

/// Where things are in a frame, in words.
namespace word {
inline constexpr std::size_t version = 0;
inline constexpr std::size_t application = 1;
inline constexpr std::size_t date = 4;
inline constexpr std::size_t channel_counts = 6;
inline constexpr std::size_t digital_mode = 10;
inline constexpr std::size_t digital_direction = 12;
inline constexpr std::size_t digital_out = 14;
inline constexpr std::size_t digital_in = 16;
inline constexpr std::size_t pwm = 20;
inline constexpr std::size_t encoder_reset = 50;
inline constexpr std::size_t encoder_index_active = 51;
inline constexpr std::size_t encoder_index_invert = 52;
inline constexpr std::size_t encoder_counter = 53;
inline constexpr std::size_t timers = 70;
inline constexpr std::size_t adc_gain = 200;
inline constexpr std::size_t adc = 204;
inline constexpr std::size_t dac = 220;
}  // namespace word

inline constexpr std::size_t pwm_channels = 10;
inline constexpr std::size_t pwm_words = 3;  ///< of each channel
inline constexpr std::size_t encoder_channels = 8;
inline constexpr std::size_t encoder_words = 2;  ///< of each channel
inline constexpr std::size_t identity_words = 9;

/// What this driver does with a group of words.
enum class Use : std::uint8_t {
  never,     ///< sent as 0
  kept,      ///< sent back as the board showed it when it was configured
  checked,   ///< must stay as it was when the board was configured; sent as 0 but for the mark
  received,  ///< read in every cycle
  sent       ///< written in every cycle
};
[[nodiscard]] std::string_view name_of(Use use) noexcept;

struct WordGroup {
  std::size_t first;
  std::size_t count;
  std::string_view name;
  std::string_view meaning;
  Standing standing;  ///< of place and meaning
  Use use;
  std::string_view open{};  ///< what is not known about it; empty: nothing
};
/// The whole frame, in order, without gaps.
[[nodiscard]] std::span<const WordGroup> words() noexcept;

/// A word of a frame; 0 past its end.
[[nodiscard]] constexpr std::uint16_t word_at(std::span<const std::uint8_t> frame, std::size_t index) noexcept {
  if (2 * index + 1 >= frame.size()) return 0;
  return static_cast<std::uint16_t>(frame[2 * index] | frame[2 * index + 1] << 8U);
}
/// Puts payload into a frame to the board: bit 15 is left out, as the board takes it for a mark.
constexpr void put_payload(Frame& frame, std::size_t index, std::uint32_t value) noexcept {
  frame[2 * index] = static_cast<std::uint8_t>(value & 0xFFU);
  frame[2 * index + 1] = static_cast<std::uint8_t>((value & payload_bits) >> 8U);
}

/// The three words of one PWM channel.
using PwmWords = std::array<std::uint16_t, pwm_words>;
/// @param prescaler 0 ... 65535; its bit 15 travels beside the mode
/// @param width 0 ... 4095
[[nodiscard]] constexpr PwmWords pwm_words_for(std::uint32_t mode, std::uint32_t prescaler,
                                               std::uint32_t width) noexcept {
  return {static_cast<std::uint16_t>(prescaler & payload_bits),
          static_cast<std::uint16_t>((mode << 1U | (prescaler >> 15U & 1U)) & payload_bits),
          static_cast<std::uint16_t>(width & 0xFFFU)};
}

/// What a frame from the board says, as far as this driver asks.
struct Contents {
  std::array<std::uint16_t, identity_words> identity{};  ///< version, application, date, channel counts
  std::uint32_t upper_raw{0};                            ///< counter of the upper wheel's channel, as it stands
  std::uint32_t lower_raw{0};
  PwmWords drive{};
  PwmWords brake{};
  std::uint16_t digital_out{0};  ///< lines 0 ... 15
};
/// Takes a frame apart. `incomplete_answer` for any length but 504, `contents` untouched then. Real-time safe.
[[nodiscard]] IoError decode(std::span<const std::uint8_t> bytes, const UsbOptions& options,
                             Contents& contents) noexcept;

/// What a frame to the board begins with: the mark, and every kept word as the board showed it.
/// @param shown a frame from the board
[[nodiscard]] Frame frame_from(std::span<const std::uint8_t, frame_bytes> shown) noexcept;

}  // namespace abs_hil::driver::usb
