#pragma once

#include <span>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/driver/backend.hpp"

namespace abs_hil::program {

/// The whole program abs_hil (command line, real-time loop, command gate, telemetry) for a `main` with its own
/// controllers (docs/writing-a-controller.md) and boards (docs/writing-a-backend.md). These appear beside the built-in
/// ones in `--controller`, `driver.kind` and `abs_hil list`.
/// @param own  controllers whose names differ from the built-in ones and from each other; prints an error and returns 2
/// otherwise
/// @param boards  the same for boards. A board needs a guardian that knows it: a program called abs_guardian beside
/// this
///                one, whose `main` is `run_guardian` with the same boards
/// @return the exit status (docs/experiments.md)
int run_program(int argc, char** argv, std::span<const control::ControllerEntry> own = {},
                std::span<const driver::Backend> boards = {});

/// The whole program abs_guardian, for a `main` with its own boards.
int run_guardian(int argc, char** argv, std::span<const driver::Backend> boards = {});

}  // namespace abs_hil::program
