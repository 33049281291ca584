#pragma once

#include <string_view>
#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "diagnosis/finding.hpp"

namespace abs_hil::diagnosis {

/// Findings of the check "boards": each board that a backend has found, and what keeps a run from using it. A missing
/// board is a note.
[[nodiscard]] std::vector<Finding> judge(std::string_view kind, const std::vector<driver::FoundBoard>& boards);

}  // namespace abs_hil::diagnosis
