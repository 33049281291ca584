// The frames of the RT-DAC/USB2 as one table of words, and the words that hold the outputs.

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"

namespace abs_hil::driver::usb {

// Frames of the RT-DAC/USB2 with generic logic 1.03, from the maker's driver sources. They have not been tested on
// hardware.

inline constexpr std::size_t frame_bytes = 504;
inline constexpr std::size_t frame_words = frame_bytes / 2;  ///< 16 bits each, low byte first

/// A frame has 504 bytes in both directions.
using Frame = std::array<std::uint8_t, frame_bytes>;

/// Request for one frame.
inline constexpr std::array<std::uint8_t, 4> frame_request{0xFF, 0x8F, 0x00, 0x00};
/// First word of a frame to the board: bytes 0F 8F. Only this mark has bit 15 set: payload has 15 bits per word.
inline constexpr std::uint16_t write_mark = 0x8F0F;
inline constexpr std::uint16_t payload_bits = 0x7FFF;

/// Offsets in a frame, in words.
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
  never,     ///< not used; sent as 0
  kept,      ///< sent back with the value that the board had at `configure`
  checked,   ///< must keep the value that it had at `configure`; sent as 0 except for the mark
  received,  ///< read in every cycle
  sent       ///< written in every cycle
};
[[nodiscard]] std::string_view name_of(Use use) noexcept;

struct WordGroup {
  std::size_t first;
  std::size_t count;
  std::string_view name;
  std::string_view meaning;
  Standing standing;  ///< how well place and meaning are known
  Use use;
  std::string_view open{};  ///< open questions about it, if any
};
/// All words of a frame, in order, without gaps.
[[nodiscard]] std::span<const WordGroup> words() noexcept;

/// A word of a frame; 0 past its end.
[[nodiscard]] constexpr std::uint16_t word_at(std::span<const std::uint8_t> frame, std::size_t index) noexcept {
  if (2 * index + 1 >= frame.size()) return 0;
  return static_cast<std::uint16_t>(frame[2 * index] | frame[2 * index + 1] << 8U);
}
/// Puts payload into a frame to the board, without bit 15: the board would take it as a mark.
constexpr void put_payload(Frame& frame, std::size_t index, std::uint32_t value) noexcept {
  frame[2 * index] = static_cast<std::uint8_t>(value & 0xFFU);
  frame[2 * index + 1] = static_cast<std::uint8_t>((value & payload_bits) >> 8U);
}

/// The three words of one PWM channel.
using PwmWords = std::array<std::uint16_t, pwm_words>;
/// @param prescaler 0 ... 65535; its bit 15 is in the word of the mode
/// @param width 0 ... 4095
[[nodiscard]] constexpr PwmWords pwm_words_for(std::uint32_t mode, std::uint32_t prescaler,
                                               std::uint32_t width) noexcept {
  return {static_cast<std::uint16_t>(prescaler & payload_bits),
          static_cast<std::uint16_t>((mode << 1U | (prescaler >> 15U & 1U)) & payload_bits),
          static_cast<std::uint16_t>(width & 0xFFFU)};
}

/// The contents of a frame from the board that this driver uses.
struct Contents {
  std::array<std::uint16_t, identity_words> identity{};  ///< version, application, date, channel counts
  std::uint32_t upper_raw{0};                            ///< raw counter of the upper wheel's channel
  std::uint32_t lower_raw{0};
  PwmWords drive{};
  PwmWords brake{};
  std::uint16_t digital_out{0};  ///< lines 0 ... 15
  std::int64_t read_ns{0};       ///< when the counters were read; not of the frame
};
/// Parses a frame. For any length other than 504 it returns `incomplete_answer` and leaves `contents` unchanged.
/// Real-time safe.
[[nodiscard]] IoError decode(std::span<const std::uint8_t> bytes, const UsbOptions& options,
                             Contents& contents) noexcept;

/// Initial frame to the board: the mark, and every kept word with the board's value.
/// @param shown a frame from the board
[[nodiscard]] Frame frame_from(std::span<const std::uint8_t, frame_bytes> shown) noexcept;

/// The words of a frame that hold the outputs of drive, brake and enable line.
struct OutputWords {
  PwmWords drive{};
  PwmWords brake{};
  std::uint16_t digital{0};  ///< all output lines; 0 without an enable line
};

/// Puts widths and enable line into a frame to the board, and returns these words. Real-time safe.
OutputWords put_outputs(Frame& frame, const UsbOptions& options, std::uint32_t drive_width, std::uint32_t brake_width,
                        bool enable) noexcept;

/// True if a frame from the board shows these words.
[[nodiscard]] bool shows(const Contents& contents, const OutputWords& words, const UsbOptions& options) noexcept;

}  // namespace abs_hil::driver::usb
