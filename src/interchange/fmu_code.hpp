#pragma once

#include <memory>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Loads the library of an extracted FMU (ForeignSetup::folder) and makes an instance. Throws std::invalid_argument.
[[nodiscard]] std::unique_ptr<ForeignCode> load_fmu(const ForeignSetup& setup);

}  // namespace abs_hil::interchange
