#pragma once

#include <memory>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "config/settings.hpp"
#include "experiment/run_logic.hpp"
#include "experiment/sequence.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

/// Makes the driver of the settings' backend; with `fast` it runs in virtual time. Throws driver::Unavailable.
[[nodiscard]] std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& settings, bool fast);
/// Wraps the driver with the settings' fault injections; returns it unchanged if there are none. `clock` must outlive
/// it. Throws std::invalid_argument for invalid fault texts.
[[nodiscard]] std::unique_ptr<driver::RigDriver> with_faults(std::unique_ptr<driver::RigDriver> driver,
                                                             const config::Settings& settings, runtime::Clock& clock);
/// Makes the parts of a run's logic. Throws std::invalid_argument. `settings` must outlive the construction of the
/// logic.
[[nodiscard]] experiment::RunLogicParts make_logic(const config::Settings& settings,
                                                   std::vector<experiment::PhasePlan> plans,
                                                   const experiment::SequenceLimits& limits = {});

}  // namespace abs_hil::program
