#pragma once

#include "runtime/realtime_setup.hpp"

namespace abs_hil::runtime {

/// True if the kernel shows locked memory of this process.
[[nodiscard]] bool memory_is_locked();
/// Locks all memory of this process, present and future.
[[nodiscard]] RealtimeStep lock_memory();
/// Grows the heap once, touches it, and keeps it from shrinking.
[[nodiscard]] RealtimeStep prefault_heap();
/// Touches the part of the calling thread's stack that a cycle may use.
[[nodiscard]] RealtimeStep prefault_stack();

}  // namespace abs_hil::runtime
