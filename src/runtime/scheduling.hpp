#pragma once

namespace abs_hil::runtime {

/// What a thread has of the real-time set-up, as the kernel tells it.
struct Scheduling {
  int fifo_priority{0};       ///< SCHED_FIFO priority; 0: another policy
  bool memory_locked{false};  ///< some memory of its process is locked
  /// True if a thread that needs `other` can be supervised from here: neither weaker in the scheduler nor in memory.
  [[nodiscard]] constexpr bool at_least(const Scheduling& other) const noexcept {
    return fifo_priority >= other.fifo_priority && (memory_locked || !other.memory_locked);
  }
};

/// Of the calling thread and its process. Not real-time safe: it reads a file.
[[nodiscard]] Scheduling scheduling_of_this_thread();

}  // namespace abs_hil::runtime
