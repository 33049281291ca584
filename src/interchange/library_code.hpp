#pragma once

#include <memory>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Loads the library, checks its functions, the version and the sizes of its interface, and makes a controller. Throws
/// std::invalid_argument, which names the file and the fix.
[[nodiscard]] std::unique_ptr<ForeignCode> load_library(const ForeignSetup& setup);

}  // namespace abs_hil::interchange
