#pragma once

#include <string>

#include "abs_hil/driver/io_result.hpp"

namespace abs_hil::driver {

/// Refuses a board with its own time under --fast, and an emulator in lock-step without --fast. Throws Unavailable.
/// @param board      how messages name it
/// @param lock_step  the program advances the board's time
/// @param waits      the board is an emulator that waits for that
/// @param start_with options that start such an emulator
inline void require_lock_step(const std::string& board, bool lock_step, bool waits,
                              const std::string& start_with = "--lock-step") {
  if (lock_step && !waits) {
    throw Unavailable("backend rig: " + board +
                      " keeps its own time: it is hardware, or an emulator in real time. Omit --fast, or start "
                      "abs_rig_emulator with " +
                      start_with);
  }
  if (!lock_step && waits) {
    throw Unavailable("backend rig: " + board +
                      " is an emulator in lock-step: give --fast --set driver.emulated=true to advance its time, or "
                      "start abs_rig_emulator without --lock-step");
  }
}

}  // namespace abs_hil::driver
