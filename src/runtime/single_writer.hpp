#pragma once

#include <atomic>

namespace abs_hil::runtime {

/// Adds to a counter that only one thread writes. A plain load and store is cheaper than a locked read-modify-write.
template <typename Integer>
void add_as_single_writer(std::atomic<Integer>& counter, Integer amount) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + amount, std::memory_order_relaxed);
}

}  // namespace abs_hil::runtime
