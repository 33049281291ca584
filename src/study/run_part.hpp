// Runs some of a study's runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "study/batch.hpp"
#include "study/study.hpp"

namespace abs_hil::study {

/// Runs some of a study's runs, in any order. The memory that it takes grows with `count`, so call it for a part after
/// the other.
/// @param run_of  the number of the run in the study, for index 0 to count - 1; called from several threads
/// @param take  takes the outcome of that index; called from several threads. An exception of it ends the part and
/// leaves
///   it.
void run_part(const Study& study, std::size_t count, std::size_t threads,
              const std::function<std::uint64_t(std::size_t index)>& run_of,
              const std::function<void(std::size_t index, Outcome outcome)>& take);

}  // namespace abs_hil::study
