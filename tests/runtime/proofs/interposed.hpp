#pragma once

#include <cstdint>

namespace abs_hil::runtime::test {

/// What a thread did while it was watched: malloc and its kin (operator new among them), and locks of any kind.
struct Offences {
  std::uint64_t allocations{0};
  std::uint64_t locks{0};
};

/// Counts the calling thread's offences as long as it lives. This program's own malloc, pthread_mutex_lock and so on
/// stand in front of the C library's.
class Watch {
 public:
  Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  ~Watch();
  [[nodiscard]] Offences so_far() const;
};

}  // namespace abs_hil::runtime::test
