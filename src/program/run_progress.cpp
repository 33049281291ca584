// Shows how far many runs are, and ends them at the first signal.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "program/signals.hpp"
#include "program/study_command.hpp"

namespace abs_hil::program {

namespace {

constexpr auto least_pause = std::chrono::milliseconds(100);
constexpr double believable_after_s = 2.0;

}  // namespace

RunProgress::RunProgress(std::uint64_t runs) : runs_(runs), terminal_(isatty(STDERR_FILENO) == 1) {
  note_signals(true);
}

RunProgress::~RunProgress() {
  if (terminal_) std::fputs("\r\033[K", stderr);
}

void RunProgress::show(std::uint64_t done) {
  if (signalled() != rig::Reason::none) throw Interrupted{done};
  if (!terminal_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  const auto now = Clock::now();
  if (!lock || now - shown_ < least_pause) return;
  shown_ = now;
  const double spent_s = std::chrono::duration<double>(now - start_).count();
  const double rate_Hz = static_cast<double>(done) / spent_s;
  // Threads begin with many runs at once, which end together: the first seconds tell no rate.
  const std::string left = spent_s < believable_after_s
                               ? ""
                               : fmt::format(", {:.0f} runs/s, {} left", rate_Hz,
                                             duration_text(static_cast<double>(runs_ - done) / rate_Hz));
  fmt::print(stderr, "\r\033[K{} of {} runs{}", done, runs_, left);
  std::fflush(stderr);
}

std::string duration_text(double seconds) {
  if (seconds < 1.0) return fmt::format("{:.0f} ms", 1e3 * seconds);
  if (seconds < 90.0) return fmt::format("{:.{}f} s", seconds, seconds < 10.0 ? 1 : 0);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

}  // namespace abs_hil::program
