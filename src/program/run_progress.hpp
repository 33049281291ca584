#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

namespace abs_hil::program {

/// A signal came while many runs were computed.
struct Interrupted {
  std::uint64_t done{0};  ///< runs that are complete
};

/// Shows the progress of many runs on stderr if that is a terminal: how many, how fast, how long it will take. Silent
/// otherwise. While it lives, a first signal (SIGINT, SIGTERM, SIGHUP) makes `show` throw Interrupted; a second one
/// ends the program at once. Thread-safe.
class RunProgress {
 public:
  /// @param runs  that will be done
  explicit RunProgress(std::uint64_t runs);
  RunProgress(const RunProgress&) = delete;
  RunProgress& operator=(const RunProgress&) = delete;
  /// Clears the line.
  ~RunProgress();
  /// @throws Interrupted  after a signal
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
