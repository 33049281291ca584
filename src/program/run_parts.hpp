#pragma once

#include <memory>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "config/settings.hpp"
#include "experiment/run_logic.hpp"
#include "experiment/sequence.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

/// The driver of the backend that the settings name; with `fast` it runs in virtual time. Throws driver::Unavailable.
[[nodiscard]] std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& settings, bool fast);
/// The same driver with the settings' faults planted before it; unchanged without any. `clock` must outlive it. Throws
/// std::invalid_argument for faults that cannot be read.
[[nodiscard]] std::unique_ptr<driver::RigDriver> with_faults(std::unique_ptr<driver::RigDriver> driver,
                                                             const config::Settings& settings, runtime::Clock& clock);
/// What a run's logic is made of. Throws std::invalid_argument. `settings` must outlive the construction of the logic.
[[nodiscard]] experiment::RunLogicParts make_logic(const config::Settings& settings,
                                                   std::vector<experiment::PhasePlan> plans,
                                                   const experiment::SequenceLimits& limits = {});

}  // namespace abs_hil::program
