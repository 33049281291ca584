#pragma once

#include <algorithm>
#include <cstdint>

namespace abs_hil::driver {

/// Leaky bucket as in LinuxCNC's hostmot2: it tolerates single losses and trips on sustained loss. It stays tripped
/// until `reset`. Real-time safe.
class LossBucket {
 public:
  /// @param cost  level that a loss adds, > 0
  /// @param relief  level that a good cycle takes away, > 0
  /// @param limit  level at which it trips, > 0
  constexpr LossBucket(std::int32_t cost, std::int32_t relief, std::int32_t limit) noexcept
      : cost_(cost), relief_(relief), limit_(limit) {}

  constexpr void lost() noexcept {
    level_ = std::min(level_ + cost_, limit_);
    if (level_ >= limit_) tripped_ = true;
  }
  constexpr void good() noexcept { level_ = std::max(level_ - relief_, 0); }
  constexpr void reset() noexcept {
    level_ = 0;
    tripped_ = false;
  }
  [[nodiscard]] constexpr bool tripped() const noexcept { return tripped_; }

 private:
  std::int32_t cost_;
  std::int32_t relief_;
  std::int32_t limit_;
  std::int32_t level_{0};
  bool tripped_{false};
};

}  // namespace abs_hil::driver
