#pragma once

namespace abs_hil::guardian {

/// `abs_guardian serve ...`: the resident service. Returns the exit status.
[[nodiscard]] int serve(int argc, const char* const* argv);

}  // namespace abs_hil::guardian
