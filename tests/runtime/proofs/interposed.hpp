#pragma once

#include <cstdint>

namespace abs_hil::runtime::test {

/// What a thread did while it was counted: calls of malloc and similar functions (also operator new), and locks.
struct Offences {
  std::uint64_t allocations{0};
  std::uint64_t locks{0};
};

/// Counts the calling thread's offences during its lifetime. This program's malloc, pthread_mutex_lock and so on
/// replace those of the C library and call them.
class OffenceCounter {
 public:
  OffenceCounter();
  OffenceCounter(const OffenceCounter&) = delete;
  OffenceCounter& operator=(const OffenceCounter&) = delete;
  ~OffenceCounter();
  [[nodiscard]] Offences so_far() const;
};

}  // namespace abs_hil::runtime::test
