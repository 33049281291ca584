#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/key_table.hpp"
#include "config/plan.hpp"

namespace abs_hil::config {

/// All that a run could do to a board, folded into one list: the keys that have a bound, wherever their values came
/// from, and what the plan's phases do, whose numbers stand in an experiment's file. A number of a phase has the bound
/// of the key that shipped experiments take it from, and a person consents to both by that key. One rule judges all.
struct SafetyRow {
  /// Accepted: weak, with a person's consent.
  enum class Verdict : std::uint8_t { told, holds, weak, accepted };
  std::string what{};   ///< the key, or what a phase does
  std::string value{};  ///< with its unit
  std::string bound{};  ///< in words, with what the key means; empty: none
  std::string fix{};    ///< the option that consents
  Verdict verdict{Verdict::told};
};
using SafetyView = std::vector<SafetyRow>;

/// @param keys, plan  of `s`
[[nodiscard]] SafetyView safety_view(const Settings& s, const KeyTable& keys, const Plan& plan);

/// Throws std::invalid_argument for the first weak row; the text names value, bound and fix.
/// @return the accepted rows, a sentence each
std::vector<std::string> refuse_weak_rows(const SafetyView& view);

/// The view as lines of text, a row each.
[[nodiscard]] std::string in_words(const SafetyView& view);

/// False for a board that is known to be an emulator: one whose files or interface are not the kernel's, or of which
/// driver.emulated says so. Cards of the kernel and adapters of a real bus are real whatever driver.emulated says.
[[nodiscard]] bool is_real_board(const driver::DriverOptions& driver);

/// Refuses what each key's own range allows and what must not reach a rig: virtual time, wheels that turn from the
/// start, answers that take longer than a period, injected faults, no guardian, a guardian that would end a healthy
/// run, and on hardware every value that weakens the protection without a person's consent. Throws
/// std::invalid_argument, which names the key and the fix. Before anything has moved.
/// @param view  of `s`
/// @return the weak values that a person has consented to, a sentence each; none for an emulator
std::vector<std::string> refuse_unsafe_use(const Settings& s, const SafetyView& view, bool virtual_time);

/// Lowers the gate's duty caps to the board's, so that the controller's anti-windup knows them, and tells the drivers
/// the encoders' resolution and the rate, which their own checks need. Throws std::invalid_argument for a cap that a
/// person has set above the board's, and for a board without caps.
/// @param keys  of `s`
void apply_board_limits(Settings& s, const KeyTable& keys);

}  // namespace abs_hil::config
