#pragma once

#include <memory>
#include <string>

#include "config/settings.hpp"
#include "driver/factory.hpp"
#include "guardian/guardian_lease.hpp"

namespace abs_hil::guardian {

/// Kind and place of the board that the options name, as text. Two processes that mean the same board have the same
/// text.
[[nodiscard]] std::string kept_board(const driver::DriverOptions& options);

/// Whether a run needs a guardian: only in real time on a board. In simulation and in virtual time nothing real moves.
[[nodiscard]] bool needs_guardian(const config::Settings& settings, bool virtual_time);

/// Asks the resident service for the outputs, if `guardian.resident` and the board call for it. Call it before the
/// driver opens the board: the service has the board until then. Null: the run starts a guardian of its own, or needs
/// none. Throws driver::Unavailable if the service refuses, if there is none and there must be one, and for a guardian
/// of the run's own that would end together with the run.
[[nodiscard]] std::unique_ptr<GuardianLease> ask_for_lease(const config::Settings& settings, bool virtual_time);

/// Which guardian stands by, and what it does not cover, in words.
[[nodiscard]] std::string who_guards(const Guard& guard, bool resident, const config::Settings& settings);

}  // namespace abs_hil::guardian
