#pragma once

#include <span>

#include "abs_hil/control/registry.hpp"

namespace abs_hil::program {

/// The whole program abs_hil, its command line, real-time loop, gate, telemetry: for a `main` that brings controllers
/// of its own (docs/writing-a-controller.md). They stand beside ours in `--controller` and `abs_hil list`, and run on
/// the simulated rig and on the real one alike.
/// @param own  names must differ from ours and from each other; throws std::invalid_argument otherwise
/// @return the exit status (docs/experiments.md)
int run_program(int argc, char** argv, std::span<const control::ControllerEntry> own = {});

}  // namespace abs_hil::program
