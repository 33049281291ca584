#pragma once

#include <cstddef>
#include <functional>

namespace abs_hil::study {

/// Calls `task(0) ... task(count - 1)` from `threads` threads (at least one), each index once, in no particular order;
/// returns when all are done. After an exception no new index is begun; the one of the lowest index that threw is
/// thrown on. Results that tasks leave in places of their own do not depend on the number of threads.
void for_each_index(std::size_t count, std::size_t threads, const std::function<void(std::size_t)>& task);

/// Threads that this machine runs at once, at least 1.
[[nodiscard]] std::size_t machine_threads() noexcept;

}  // namespace abs_hil::study
