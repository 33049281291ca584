// Puts outputs into a frame and takes measurements out of one.
#include "driver/board_options.hpp"
#include "driver/usb/wire.hpp"

namespace abs_hil::driver::usb {

namespace {

using enum Standing;
using enum Use;

constexpr std::array<WordGroup, 21> table{{
    {word::version, 1, "version", "of the logic; the mark 8F0F in frames to the board", documented, checked,
     "whether the mark replaces this word or precedes it; inferred: replaces it"},
    {word::application, 3, "application", "name of the logic", documented, checked, "its coding"},
    {word::date, 2, "date", "of the logic", documented, checked, "its coding"},
    {word::channel_counts, 3, "channel counts", "of the logic", documented, checked, "which bits count what"},
    {9, 1, "-", "", unknown, never, "all of it"},
    {word::digital_mode, 2, "digital mode", "", documented, kept, "what the modes are"},
    {word::digital_direction, 2, "digital direction", "1 = in; the enable line's bit is 0", documented, sent,
     "how lines above 14 fit into 15 bits per word; the driver does not offer them"},
    {word::digital_out, 2, "digital out", "the enable line's bit", documented, sent},
    {word::digital_in, 2, "digital in", "", documented, never},
    {18, 2, "-", "", unknown, never, "all of it"},
    {word::pwm, pwm_channels* pwm_words, "PWM",
     "per channel: prescaler bits 14:0; mode << 1 | prescaler bit 15; width, 12 bits. Drive and brake are sent, the "
     "others kept",
     documented, sent, "whether the board shows them as sent; clock (40 MHz on the PCI board); number of channels"},
    {word::encoder_reset, 1, "encoder reset", "always sent as 0: counters are zeroed in software", documented, sent},
    {word::encoder_index_active, 1, "encoder index active", "always sent as 0: the index pulse changes no counter",
     documented, sent},
    {word::encoder_index_invert, 1, "encoder index invert", "", documented, kept},
    {word::encoder_counter, encoder_channels* encoder_words, "encoder counters",
     "32 bits per channel, low word first, two's complement", documented, received,
     "which word is the low one (inferred); number of channels"},
    {69, 1, "-", "", unknown, never, "all of it"},
    {word::timers, 6, "timers", "", documented, kept, "what they count"},
    {76, 124, "-", "", unknown, never, "all of it"},
    {word::adc_gain, 4, "ADC gain", "", documented, kept},
    {word::adc, 16, "ADC", "12 bits, bit 12 busy", documented, never},
    {word::dac, frame_words - word::dac, "DAC and rest", "220 ... 223: 14 bits, -10 V ... 10 V; the rest is not known",
     documented, kept, "the code of 0 V: connect nothing to the DACs"},
}};

PwmWords pwm_at(std::span<const std::uint8_t> frame, std::int32_t channel) noexcept {
  const std::size_t at = word::pwm + pwm_words * static_cast<std::size_t>(channel);
  return {word_at(frame, at), word_at(frame, at + 1), word_at(frame, at + 2)};
}

std::uint32_t counter_at(std::span<const std::uint8_t> frame, std::int32_t channel) noexcept {
  const std::size_t at = word::encoder_counter + encoder_words * static_cast<std::size_t>(channel);
  return word_at(frame, at) | static_cast<std::uint32_t>(word_at(frame, at + 1)) << 16U;
}

}  // namespace

std::span<const WordGroup> words() noexcept { return table; }

std::string_view name_of(Use use) noexcept {
  constexpr std::array<std::string_view, 5> names{"never", "kept", "checked", "received", "sent"};
  return names[static_cast<std::size_t>(use)];
}

IoError decode(std::span<const std::uint8_t> bytes, const UsbOptions& options, Contents& contents) noexcept {
  if (bytes.size() != frame_bytes) return IoError::incomplete_answer;
  for (std::size_t i = 0; i < identity_words; ++i) contents.identity[i] = word_at(bytes, i);
  contents.upper_raw = counter_at(bytes, options.upper_channel);
  contents.lower_raw = counter_at(bytes, options.lower_channel);
  contents.drive = pwm_at(bytes, options.drive_pwm);
  contents.brake = pwm_at(bytes, options.brake_pwm);
  contents.digital_out = word_at(bytes, word::digital_out);
  return IoError::none;
}

Frame frame_from(std::span<const std::uint8_t, frame_bytes> shown) noexcept {
  Frame frame{};
  for (const WordGroup& group : table) {
    if (group.use != kept && group.use != sent) continue;
    for (std::size_t i = group.first; i < group.first + group.count; ++i) put_payload(frame, i, word_at(shown, i));
  }
  put_payload(frame, word::encoder_reset, 0);
  put_payload(frame, word::encoder_index_active, 0);
  // The mark is not payload; only it has bit 15 set.
  frame[0] = static_cast<std::uint8_t>(write_mark & 0xFFU);
  frame[1] = static_cast<std::uint8_t>(write_mark >> 8U);
  return frame;
}

namespace {

std::uint32_t enable_bit(const UsbOptions& options) noexcept {
  return options.enable_line < 0 ? 0U : 1U << static_cast<std::uint32_t>(options.enable_line);
}

}  // namespace

OutputWords put_outputs(Frame& frame, const UsbOptions& options, std::uint32_t drive_width, std::uint32_t brake_width,
                        bool enable) noexcept {
  const auto put = [&frame](std::int32_t channel, const PwmWords& words) {
    const std::size_t at = word::pwm + pwm_words * static_cast<std::size_t>(channel);
    for (std::size_t i = 0; i < words.size(); ++i) put_payload(frame, at + i, words[i]);
  };
  const auto mode = static_cast<std::uint32_t>(pwm_mode_named(options.pwm_mode));
  const auto prescaler = static_cast<std::uint32_t>(options.pwm_prescaler);
  OutputWords words{.drive = pwm_words_for(mode, prescaler, drive_width),
                    .brake = pwm_words_for(mode, prescaler, brake_width)};
  put(options.drive_pwm, words.drive);
  put(options.brake_pwm, words.brake);
  const std::uint32_t line = enable_bit(options);
  if (line == 0) return words;
  const std::uint32_t others = word_at(frame, word::digital_out) & ~line;
  words.digital = static_cast<std::uint16_t>(others | (enable != options.enable_inverted ? line : 0U));
  put_payload(frame, word::digital_out, words.digital);
  put_payload(frame, word::digital_direction, word_at(frame, word::digital_direction) & ~line);
  return words;
}

bool shows(const Contents& contents, const OutputWords& words, const UsbOptions& options) noexcept {
  return contents.drive == words.drive && contents.brake == words.brake &&
         ((contents.digital_out ^ words.digital) & enable_bit(options)) == 0;
}

}  // namespace abs_hil::driver::usb
