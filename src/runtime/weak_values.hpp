#pragma once

#include <string>

#include "abs_hil/rig/option.hpp"

namespace abs_hil::runtime {

/// Everything below `unsafe.` in the configuration: each key names a risk that a person accepts on hardware.
struct UnsafeOptions {
  ABS_HIL_OPTIONS(UnsafeOptions);
  ABS_HIL_OPTION(bool, outputs_on_after_death, false,
                 .meaning =
                     "accept motor and brake on for longer than 50 ms after the program's death: allows "
                     "guardian.timeout_ms above 40, driver.can.watchdog_ms above 50",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(bool, blind_control, false,
                 .meaning =
                     "accept outputs on without fresh samples for longer than 50 ms: allows "
                     "gate.sample_age_max_s above 0.05",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(bool, foreign_controller, false,
                 .meaning =
                     "accept that code from a file, which no test of this project has seen, runs in the control cycle: "
                     "allows --controller FILE on a board",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(std::string, keys, "",
                 .meaning =
                     "accept the values of these keys, separated by commas, although they weaken the protection of a "
                     "board: docs/rig-setup.md",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
};

/// An option whose value weakens the protection of a board (rig::SafetyClass).
struct WeakValue {
  std::string key{};
  std::string value{};
  std::string class_text{};  ///< "weakens above 250 rad/s"
  std::string consent{};     ///< an option of `unsafe.` that consents beside `unsafe.keys`; empty: none
  std::string meaning{};
};

/// True if a person has consented to the value: by its key in `unsafe.keys`, or by the flag that its row names.
[[nodiscard]] bool has_consent(const WeakValue& weak, const UnsafeOptions& unsafe);

}  // namespace abs_hil::runtime
