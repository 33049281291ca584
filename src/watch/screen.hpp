#pragma once

#include <cstdint>
#include <string>

#include "watch/cell_grid.hpp"
#include "watch/run_view.hpp"

namespace abs_hil::watch {

/// How large the screen is, what it can show, and where the messages come from.
struct ScreenOptions {
  int columns{80};
  int rows{24};
  bool unicode{true};     ///< braille and Greek letters; else ASCII alone
  std::string source{};   ///< LCM URL
  std::string channel{};  ///< of the telemetry, as in "ABS_TELEMETRY"
};

/// The whole screen, from nothing but the arguments. Any size will do; what there is no room for is left out.
[[nodiscard]] CellGrid draw_screen(const RunView& view, std::int64_t now_ns, const ScreenOptions& options);

/// The same in one line of UTF-8 or ASCII, without line end, for where there is no terminal.
[[nodiscard]] std::string one_line(const RunView& view, std::int64_t now_ns, const ScreenOptions& options);

}  // namespace abs_hil::watch
