#include "program/run_progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace abs_hil::program {

namespace {

constexpr auto least_pause = std::chrono::milliseconds(100);

}  // namespace

RunProgress::RunProgress(std::uint64_t runs) : runs_(runs), terminal_(isatty(STDERR_FILENO) == 1) {}

RunProgress::~RunProgress() {
  if (terminal_) std::fputs("\r\033[K", stderr);
}

void RunProgress::show(std::uint64_t done) {
  if (!terminal_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  const auto now = Clock::now();
  if (!lock || now - shown_ < least_pause) return;
  shown_ = now;
  const double spent_s = std::chrono::duration<double>(now - start_).count();
  const double rate_Hz = static_cast<double>(done) / spent_s;
  fmt::print(stderr, "\r\033[K{} of {} runs, {:.0f} runs/s, {} left", done, runs_, rate_Hz,
             duration_text(static_cast<double>(runs_ - done) / rate_Hz));
  std::fflush(stderr);
}

std::string duration_text(double seconds) {
  if (seconds < 1.0) return fmt::format("{:.0f} ms", 1e3 * seconds);
  if (seconds < 90.0) return fmt::format("{:.{}f} s", seconds, seconds < 10.0 ? 1 : 0);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

}  // namespace abs_hil::program
