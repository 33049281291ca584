#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

namespace abs_hil::program {

/// Shows the progress of many runs on stderr if that is a terminal: how many, how fast, how long it will take. Silent
/// otherwise. Thread-safe.
class RunProgress {
 public:
  /// @param runs  that will be done
  explicit RunProgress(std::uint64_t runs);
  RunProgress(const RunProgress&) = delete;
  RunProgress& operator=(const RunProgress&) = delete;
  /// Clears the line.
  ~RunProgress();
  void show(std::uint64_t done);

 private:
  using Clock = std::chrono::steady_clock;

  std::uint64_t runs_;
  bool terminal_;
  Clock::time_point start_{Clock::now()};
  Clock::time_point shown_{};
  std::mutex mutex_{};
};

/// "420 ms", "1.6 s", "12 s", "3 min", "5.2 h".
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace abs_hil::program
