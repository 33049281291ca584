#pragma once

#include <memory>
#include <string>

#include "driver/factory.hpp"

namespace abs_hil::guardian {

/// Kind and place of the board that the options name, as text. Two processes that mean the same board have the same
/// text.
[[nodiscard]] std::string kept_board(const driver::DriverOptions& options);

/// The writer of that board's safe state. @param beside_guardian  it works although a guardian keeps the board. Throws
/// driver::Unavailable for a kind without one.
[[nodiscard]] std::unique_ptr<driver::SafeStateWriter> safe_state_writer_of(const driver::DriverOptions& options,
                                                                            bool beside_guardian = false);

}  // namespace abs_hil::guardian
