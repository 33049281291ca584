#pragma once

namespace abs_hil::guardian {

/// True if abs_hil started this program as the guardian of one run.
[[nodiscard]] bool started_by_a_run();
/// The guardian of one run. Returns the exit status.
[[nodiscard]] int guard_one_run();

}  // namespace abs_hil::guardian
