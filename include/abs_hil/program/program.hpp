#pragma once

#include <span>

#include "abs_hil/control/registry.hpp"

namespace abs_hil::program {

/// The whole program abs_hil (command line, real-time loop, command gate, telemetry) for a `main` with its own
/// controllers (docs/writing-a-controller.md). These appear beside the built-in ones in `--controller` and `abs_hil
/// list`, and run on the simulated and the real rig.
/// @param own  controllers whose names differ from the built-in ones and from each other; throws std::invalid_argument
/// otherwise
/// @return the exit status (docs/experiments.md)
int run_program(int argc, char** argv, std::span<const control::ControllerEntry> own = {});

}  // namespace abs_hil::program
