#pragma once

#include <memory>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/experiment/run_logic.hpp"
#include "abs_hil/experiment/sequence.hpp"
#include "abs_hil/settings/settings.hpp"

namespace abs_hil::app {

/// The driver of the backend that the settings name; with `fast` it runs in virtual time. Throws driver::Unavailable.
[[nodiscard]] std::unique_ptr<driver::RigDriver> make_driver(const settings::Settings& settings, bool fast);
/// What a run's logic is made of. Throws std::invalid_argument. `settings` must outlive the construction of the logic.
[[nodiscard]] experiment::RunLogicParts make_logic(const settings::Settings& settings,
                                                   std::vector<experiment::PhasePlan> plans);

}  // namespace abs_hil::app
