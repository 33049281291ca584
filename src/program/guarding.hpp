#pragma once

#include <memory>
#include <string>

#include "guardian/guardian_lease.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Whether a run needs a guardian: only in real time on a board. In simulation and in virtual time nothing real moves.
[[nodiscard]] bool needs_guardian(const RunRequest& request);

/// Asks the resident service for the outputs, if `guardian.resident` and the board call for it. Call it before the
/// driver opens the board: the service has the board until then. Null: the run starts a guardian of its own, or needs
/// none. Throws driver::Unavailable if the service refuses, if there is none and there must be one, and for a guardian
/// of the run's own that would end together with the run.
[[nodiscard]] std::unique_ptr<guardian::GuardianLease> ask_for_lease(const RunRequest& request);

/// Which guardian stands by, and what it does not cover, in words.
[[nodiscard]] std::string who_guards(const guardian::Guard& guard, bool resident, const RunRequest& request);

}  // namespace abs_hil::program
