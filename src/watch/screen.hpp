#pragma once

#include <cstdint>
#include <string>

#include "watch/cell_grid.hpp"
#include "watch/run_view.hpp"

namespace abs_hil::watch {

/// Size and abilities of the screen, and the source of the messages.
struct ScreenOptions {
  int columns{80};
  int rows{24};
  bool unicode{true};     ///< with braille and Greek letters; else ASCII only
  std::string source{};   ///< LCM URL
  std::string channel{};  ///< telemetry channel, as "ABS_TELEMETRY"
};

/// Draws the whole screen from the arguments alone. Any size works; what does not fit is left out.
[[nodiscard]] CellGrid draw_screen(const RunView& view, std::int64_t now_ns, const ScreenOptions& options);

/// The same as one line of UTF-8 or ASCII without line end, for use without a terminal.
[[nodiscard]] std::string one_line(const RunView& view, std::int64_t now_ns, const ScreenOptions& options);

}  // namespace abs_hil::watch
