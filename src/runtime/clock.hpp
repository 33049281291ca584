#pragma once

#include <algorithm>
#include <cstdint>

namespace abs_hil::runtime {

/// Monotonic time in ns, injected so that the same cycle runs in real time, in virtual time and in tests.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual std::int64_t now_ns() noexcept = 0;
  /// Sleeps until `time_ns` or a little later; returns at once if that time has passed.
  virtual void sleep_until(std::int64_t time_ns) noexcept = 0;
  /// For how long the computer has been suspended so far, ns: this time is missing in `now_ns`. It may be a little
  /// less than the true value, never more, and counts from any origin. 0 if the clock cannot know.
  [[nodiscard]] virtual std::int64_t suspended_ns() noexcept { return 0; }
};

/// CLOCK_MONOTONIC with absolute sleeps. Real-time safe.
class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override;
  void sleep_until(std::int64_t time_ns) noexcept override;
  [[nodiscard]] std::int64_t suspended_ns() noexcept override;
};

/// Virtual time: it advances only in `sleep_until`. Every wake-up is exact and every computation takes no time.
class VirtualClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override { return now_ns_; }
  void sleep_until(std::int64_t time_ns) noexcept override {
    if (time_ns > now_ns_) now_ns_ = time_ns;
  }

 private:
  std::int64_t now_ns_{0};
};

/// Finds each suspension of the computer between two looks. Real-time safe.
class SuspensionFinder {
 public:
  /// A reading may be too small by as long as the thread was held up in it. A start from such a reading would take the
  /// missing time for a suspension at the next look, so the largest of several readings is the start.
  void begin(Clock& clock) noexcept {
    most_ns_ = clock.suspended_ns();
    for (int more = 0; more < 7; ++more) most_ns_ = std::max(most_ns_, clock.suspended_ns());
  }
  /// The time suspended since the latest look, ns; 0 if it was at most 1 ms, which is far above the resolution of the
  /// clocks and far below the shortest suspension.
  [[nodiscard]] std::int64_t look(Clock& clock) noexcept {
    const std::int64_t told_ns = clock.suspended_ns();
    const std::int64_t found_ns = told_ns - most_ns_;
    most_ns_ = std::max(most_ns_, told_ns);
    return found_ns > 1'000'000 ? found_ns : 0;
  }

 private:
  std::int64_t most_ns_{0};  ///< most that the clock has told
};

}  // namespace abs_hil::runtime
