#pragma once

#include <string>

namespace abs_hil::runtime {

/// Commands for a shell that give this program SCHED_FIFO and locked memory, for good.
[[nodiscard]] std::string privilege_fix();
/// The same, with what else may keep the scheduler from granting `priority`.
[[nodiscard]] std::string fifo_fix(int priority);
/// Commands that let the group realtime open /dev/cpu_dma_latency.
[[nodiscard]] std::string cpu_latency_fix();

}  // namespace abs_hil::runtime
