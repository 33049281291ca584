#pragma once

#include <unistd.h>

#include <cstdint>
#include <string>

#include "driver/monotonic_time.hpp"

namespace abs_hil::driver {

/// When a safe-state writer looks again for a board that is gone. A guard calls it every few ms, and looking for a
/// board reads many files and allocates. So it looks every 100 ms; and every 5 ms at most as long as there is a file
/// that only the present board has. A call that is not due costs one system call.
class Reopening {
 public:
  using ReadClock = std::int64_t (*)() noexcept;
  explicit Reopening(std::string file = {}, ReadClock read_clock = monotonic_ns)
      : file_(std::move(file)), read_clock_(read_clock) {}

  /// True if the board should be looked for now; then it is not due again for a while.
  [[nodiscard]] bool due() noexcept {
    const std::int64_t now_ns = read_clock_();
    const bool there = !file_.empty() && ::access(file_.c_str(), F_OK) == 0;
    if (tried_ && now_ns - tried_ns_ < (there ? near_ns : far_ns)) return false;
    tried_ = true;
    tried_ns_ = now_ns;
    return true;
  }
  /// The file that shows the board which was found.
  void found(std::string file) { file_ = std::move(file); }

 private:
  static constexpr std::int64_t near_ns = 5'000'000;
  static constexpr std::int64_t far_ns = 100'000'000;
  std::string file_;
  ReadClock read_clock_;
  bool tried_{false};
  std::int64_t tried_ns_{0};
};

}  // namespace abs_hil::driver
