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

}  // namespace abs_hil::config
