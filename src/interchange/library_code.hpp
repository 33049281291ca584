#pragma once

#include <memory>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Checks a shared library in its file, without running anything of it: its kind, its functions, the version and the
/// sizes of its interface. Throws std::invalid_argument, which names the file and the fix.
void check_library(const std::filesystem::path& file);

/// Checks the library, loads it and makes a controller. Throws std::invalid_argument.
[[nodiscard]] std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup);

}  // namespace abs_hil::interchange
