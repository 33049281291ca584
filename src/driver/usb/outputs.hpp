#pragma once

#include "driver/usb/frame.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::driver::usb {

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
