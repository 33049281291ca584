#include "driver/usb/outputs.hpp"

#include "driver/pwm.hpp"

namespace abs_hil::driver::usb {

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
