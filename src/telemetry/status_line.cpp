// The line on the terminal during a run: phase, slip, latencies, drops.
#include "telemetry/status_line.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

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

/// Columns that a terminal needs for UTF-8. Combining marks take none.
int columns_for(std::string_view text) {
  return static_cast<int>(std::ranges::count_if(text, [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    const bool continuation = (byte & 0xC0U) == 0x80U;
    const bool combining = byte == 0xCC;  // U+0300 to U+033F: the hat of theta
    return !continuation && !combining;
  }));
}

std::string quantiles(const rig::DurationQuantiles& q) {
  return fmt::format("{:.0f}/{:.0f}/{:.0f}/{:.0f}", q.p50_us, q.p99_us, q.p99_9_us, q.max_us);
}

std::vector<std::string> fields_of(const rig::CycleRecord& record, const StatusSnapshot& status) {
  const rig::WheelSpeeds speeds = rig::best_speeds(record);
  std::vector<std::string> fields{fmt::format("{:<10} ω1 {}  ω2 {} rad/s", rig::name_of(record.phase),
                                              number(speeds.omega1_rad_s, 6, 1), number(speeds.omega2_rad_s, 6, 1)),
                                  fmt::format("slip {}", number(rig::best_slip(record), 5, 2)),
                                  fmt::format("θ̂ {} N", number(record.control.theta_est_N, 6, 2)),
                                  fmt::format("overruns {}", status.timing.overruns.total),
                                  fmt::format("drops {}", status.telemetry_drops),
                                  fmt::format("gate {}", status.gate_interventions)};
  const bool timed =
      std::isfinite(status.timing.wakeup_latency.p50_us) && std::isfinite(status.timing.cycle_time.p50_us);
  if (timed) {
    fields.push_back(fmt::format("wake-up {} us", quantiles(status.timing.wakeup_latency)));
    fields.push_back(fmt::format("cycle {} us", quantiles(status.timing.cycle_time)));
  }
  return fields;
}

}  // namespace

std::string format_status_line(const rig::CycleRecord& record, const StatusSnapshot& status, int columns) {
  std::string line;
  for (const std::string& field : fields_of(record, status)) {
    const std::string_view gap = line.empty() ? "" : "  ";
    if (columns_for(line) + columns_for(gap) + columns_for(field) > columns) break;
    line.append(gap).append(field);
  }
  return line;
}

StatusLine::StatusLine(StatusSource status, int file)
    : status_(std::move(status)), file_(file), active_(::isatty(file) == 1) {}

StatusLine::~StatusLine() { erase(); }

void StatusLine::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  if (!active_ || (next_draw_ns_ && record.stamp_ns < *next_draw_ns_)) return;
  next_draw_ns_ = record.stamp_ns + draw_period_ns;
  std::string line(erase_line);
  const int columns = columns_of(file_) - 1;  // a full line would make some terminals scroll
  line += format_status_line(record, status_ ? status_() : StatusSnapshot{}, columns);
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
