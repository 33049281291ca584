#include "telemetry/status_line.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <string>
#include <utility>

namespace abs_hil::telemetry {
namespace {

constexpr std::int64_t draw_period_ns = 100'000'000;
constexpr std::string_view erase_line = "\r\x1b[K";

int columns_of(int file) {
  winsize size{};
  return ::ioctl(file, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

/// "-" for an unknown number.
std::string number(double value, int width, int decimals) {
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:{}.{}f}", value, width, decimals);
}

/// Wake-up latency and cycle time as p50/p99/p99.9/max; empty while nothing has been measured.
std::string timing_text(const StatusSnapshot& status) {
  const rig::DurationQuantiles& wakeup = status.wakeup_latency;
  const rig::DurationQuantiles& cycle = status.cycle_time;
  if (!std::isfinite(wakeup.p50_us) || !std::isfinite(cycle.p50_us)) return {};
  return fmt::format("  wake-up {:.0f}/{:.0f}/{:.0f}/{:.0f}  cycle {:.0f}/{:.0f}/{:.0f}/{:.0f} us", wakeup.p50_us,
                     wakeup.p99_us, wakeup.p99_9_us, wakeup.max_us, cycle.p50_us, cycle.p99_us, cycle.p99_9_us,
                     cycle.max_us);
}

}  // namespace

std::string format_status_line(const rig::CycleRecord& record, const StatusSnapshot& status) {
  const rig::WheelSpeeds speeds = rig::best_speeds(record);
  return fmt::format("{:<10} ω1 {}  ω2 {} rad/s  slip {}  θ̂ {} N  overruns {}  drops {}  gate {}{}",
                     rig::name_of(record.phase), number(speeds.omega1_rad_s, 6, 1), number(speeds.omega2_rad_s, 6, 1),
                     number(rig::best_slip(record), 5, 2), number(record.control.theta_est_N, 6, 2), status.overruns,
                     status.telemetry_drops, status.gate_interventions, timing_text(status));
}

std::string_view cut_to_columns(std::string_view text, int columns) noexcept {
  int used = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool continuation = (byte & 0xC0U) == 0x80U;
    const bool combining = byte == 0xCC;  // U+0300 to U+033F: the hat of theta
    if (continuation || combining) continue;
    if (used == columns) return text.substr(0, i);
    ++used;
  }
  return text;
}

StatusLine::StatusLine(StatusSource status, int file)
    : status_(std::move(status)), file_(file), active_(::isatty(file) == 1) {}

StatusLine::~StatusLine() { erase(); }

void StatusLine::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  if (!active_ || (next_draw_ns_ && record.stamp_ns < *next_draw_ns_)) return;
  next_draw_ns_ = record.stamp_ns + draw_period_ns;
  const std::string text = format_status_line(record, status_ ? status_() : StatusSnapshot{});
  std::string line(erase_line);
  line += cut_to_columns(text, columns_of(file_) - 1);  // a full line would make some terminals scroll
  put(line);
  drawn_ = true;
}

void StatusLine::erase() noexcept {
  if (drawn_) put(erase_line);
  drawn_ = false;
}

void StatusLine::put(std::string_view text) noexcept {
  pollfd ready{file_, POLLOUT, 0};
  if (::poll(&ready, 1, 0) <= 0 || (ready.revents & POLLOUT) == 0) return;
  // A failure is ignored, because the line is not essential.
  [[maybe_unused]] const auto written = ::write(file_, text.data(), text.size());
}

}  // namespace abs_hil::telemetry
