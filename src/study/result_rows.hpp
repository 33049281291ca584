// The columns and rows of a study's results.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "study/batch.hpp"
#include "study/study.hpp"

namespace abs_hil::study {

/// The columns of a study's results: number of the run, what it is made of, how it ended, its metrics.
[[nodiscard]] std::vector<std::string> result_columns(const Study& study);
/// A row of CSV with these columns and a line end; the same for the same run on every computer.
/// @param own  the study's own metrics, in order; empty: all unknown
[[nodiscard]] std::string result_row(const Study& study, std::uint64_t run, const Outcome& outcome,
                                     const std::vector<double>& own = {});

/// A field of CSV, in quotes if it needs them.
[[nodiscard]] std::string csv_field(const std::string& text);

}  // namespace abs_hil::study
