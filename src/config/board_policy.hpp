#pragma once

#include <string>
#include <vector>

#include "config/key_table.hpp"

namespace abs_hil::config {

/// Asks the board what it is: it is real unless it carries an emulator's mark. `driver.emulated` becomes what it shows.
/// A board that is silent keeps what somebody demands, because `configure` refuses one without the mark. Throws
/// std::invalid_argument if driver.emulated demands an emulator and there is none, Unavailable if somebody drives it.
void learn_reality(driver::DriverOptions& driver);

/// True unless the board has shown an emulator's mark (`learn_reality`).
[[nodiscard]] inline bool is_real_board(const driver::DriverOptions& driver) noexcept { return !driver.emulated; }

/// What a run does not ask of an emulator, as a line for a person.
inline constexpr const char* waived_for_emulator =
    "the board carries an emulator's mark: no commissioning record, resident guardian or real time is required, and "
    "weak limits, controllers from files and injected faults are allowed";

/// Refuses what each key's own range allows and what must not reach a rig: virtual time, wheels that turn from the
/// start, answers that take longer than a period, injected faults, no guardian, a guardian that would end a healthy
/// run, and on hardware every value that weakens the protection without a person's consent. Throws
/// std::invalid_argument, which names the key and the fix. Before anything has moved.
/// @param keys  of `s`
/// @return the weak values that a person has consented to, a sentence each; none for an emulator
std::vector<std::string> refuse_unsafe_use(const Settings& s, const KeyTable& keys, bool virtual_time);

/// Lowers the gate's duty caps to the board's, so that the controller's anti-windup knows them, and tells the drivers
/// the encoders' resolution and the rate, which their own checks need. Throws std::invalid_argument for a cap that a
/// person has set above the board's, and for a board without caps.
/// @param keys  of `s`
void apply_board_limits(Settings& s, const KeyTable& keys);

}  // namespace abs_hil::config
