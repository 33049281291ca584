// A board on a serial line, an Arduino say, as a backend of abs_hil: driver.kind=serial.
#pragma once

#include <abs_hil/driver/backend.hpp>

namespace serial_board {

/// The entry for the registries of both programs.
[[nodiscard]] abs_hil::driver::Backend serial_backend();

}  // namespace serial_board
