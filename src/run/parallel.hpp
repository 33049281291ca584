// A loop over several threads. It keeps the failure of the lowest index, so that errors do not depend on threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace abs_hil::run {

/// Calls `task(0) ... task(count - 1)` from `threads` threads (at least one), each index once, in any order, and
/// returns when all are done. After an exception it starts no new index and rethrows the exception with the lowest
/// index. If each task writes only to its own place, the results do not depend on the number of threads.
inline void for_each_index(std::size_t count, std::size_t threads, const std::function<void(std::size_t)>& task) {
  std::atomic<std::size_t> next{0};
  std::mutex failure_mutex;
  std::exception_ptr failure;
  std::size_t failed_index = count;
  const auto work = [&] {
    for (std::size_t index = next.fetch_add(1); index < count; index = next.fetch_add(1)) {
      try {
        task(index);
      } catch (...) {
        const std::scoped_lock lock(failure_mutex);
        if (index < failed_index) {
          failed_index = index;
          failure = std::current_exception();
        }
        next.store(count);
      }
    }
  };
  {
    std::vector<std::jthread> pool;
    for (std::size_t i = 1; i < std::min(threads, count); ++i) pool.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

/// Number of threads that this computer runs at once, at least 1.
[[nodiscard]] inline std::size_t machine_threads() noexcept {
  return std::max(1U, std::thread::hardware_concurrency());
}

}  // namespace abs_hil::run
