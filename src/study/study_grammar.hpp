#pragma once

#include "config/grammar.hpp"

namespace abs_hil::study {

// The tables of a study's file.
[[nodiscard]] const config::Grammar& study_grammar();
[[nodiscard]] const config::Grammar& design_grammar();
[[nodiscard]] const config::Grammar& repeat_grammar();
[[nodiscard]] const config::Grammar& metric_grammar();
/// A range of a factor, or equally spaced values.
[[nodiscard]] const config::Grammar& range_grammar();

}  // namespace abs_hil::study
