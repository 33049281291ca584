#pragma once

#include <string>

namespace abs_hil::runtime {

/// Shell commands that permit this program SCHED_FIFO and locked memory permanently.
[[nodiscard]] std::string privilege_fix();
/// The same commands, and fixes for other causes that keep the scheduler from granting `priority`.
[[nodiscard]] std::string fifo_fix(int priority);
/// Shell commands that let the group realtime open /dev/cpu_dma_latency.
[[nodiscard]] std::string cpu_latency_fix();

}  // namespace abs_hil::runtime
