// A loop over several threads.
#pragma once

#include <cstddef>
#include <functional>

namespace abs_hil::study {

/// Calls `task(0) ... task(count - 1)` from `threads` threads (at least one), each index once, in any order, and
/// returns when all are done. After an exception it starts no new index and rethrows the exception with the lowest
/// index. If each task writes only to its own place, the results do not depend on the number of threads.
void for_each_index(std::size_t count, std::size_t threads, const std::function<void(std::size_t)>& task);

/// Number of threads that this computer runs at once, at least 1.
[[nodiscard]] std::size_t machine_threads() noexcept;

}  // namespace abs_hil::study
