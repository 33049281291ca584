#include "watch/watch_session.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <stdexcept>

#include "abs_hil/rig/time_units.hpp"
#include "telemetry/run_listener.hpp"
#include "watch/run_view.hpp"
#include "watch/screen.hpp"
#include "watch/terminal.hpp"

namespace abs_hil::watch {
namespace {

constexpr std::int64_t draw_period_ns = 100 * rig::ns_per_ms;
constexpr std::int64_t line_period_ns = 1'000 * rig::ns_per_ms;
constexpr int picture_columns = 100;
constexpr int picture_rows = 32;

std::int64_t monotonic_ns() {
  using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::steady_clock;
  return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

/// Puts received messages with their arrival times into a view.
class ViewFeed : public telemetry::RunObserver {
 public:
  explicit ViewFeed(double window_s) : view_(window_s) {}
  void take(const telemetry_t& message) override { view_.take(message, monotonic_ns()); }
  void take(const status_t& message) override { view_.take(message, monotonic_ns()); }
  void take(const event_t& message) override { view_.take(message, monotonic_ns()); }
  void take(const experiment_t& message) override { view_.take(message, monotonic_ns()); }
  void take_malformed() override { view_.note_malformed(); }
  [[nodiscard]] const RunView& view() const noexcept { return view_; }

 private:
  RunView view_;
};

class Session {
 public:
  Session(const WatchOptions& options, const std::function<bool()>& stop)
      : options_(options), stop_(stop), feed_(options.window_s), listener_(options.url, options.prefix, feed_) {
    screen_.source = listener_.url();
    screen_.channel = options.prefix + "TELEMETRY";
  }

  WatchEnd on_terminal() {
    Terminal terminal;
    screen_.unicode = terminal.unicode() && !options_.ascii;
    while (!stop_()) {
      screen_.columns = terminal.columns();
      screen_.rows = terminal.rows();
      terminal.show(draw_screen(feed_.view(), monotonic_ns(), screen_));
      const std::int64_t next_ns = monotonic_ns() + draw_period_ns;
      while (monotonic_ns() < next_ns && !stop_()) {
        if (wait(next_ns, true)) return WatchEnd::quit;  // the terminal was closed
        for (int key = terminal.key(); key != 0; key = terminal.key()) {
          if (key == 'q' || key == 'Q') return WatchEnd::quit;
        }
      }
    }
    return WatchEnd::stopped;
  }

  WatchEnd in_lines() {
    screen_.unicode = locale_is_utf8() && !options_.ascii;
    std::int64_t next_ns = monotonic_ns() + line_period_ns;
    while (!stop_()) {
      wait(next_ns, false);
      if (monotonic_ns() < next_ns) continue;
      next_ns += line_period_ns;
      if (!print(one_line(feed_.view(), monotonic_ns(), screen_) + '\n')) return WatchEnd::quit;
    }
    return WatchEnd::stopped;
  }

  WatchEnd one_picture() {
    screen_.unicode = locale_is_utf8() && !options_.ascii;
    screen_.columns = picture_columns;
    screen_.rows = picture_rows;
    const std::int64_t start_ns = monotonic_ns();
    const std::int64_t end_ns = start_ns + static_cast<std::int64_t>(options_.once_timeout_s * 1e9);
    // Complete with a status and one second of telemetry, so that there is a message rate to show.
    const auto complete = [&] {
      const RunView& view = feed_.view();
      return view.status() && !view.samples().empty() &&
             monotonic_ns() - view.samples().front().received_ns > line_period_ns;
    };
    while (!stop_() && !complete() && monotonic_ns() < end_ns) {
      wait(std::min(end_ns, monotonic_ns() + draw_period_ns), false);
    }
    if (stop_()) return WatchEnd::stopped;
    if (!feed_.view().telemetry() && !feed_.view().status()) return WatchEnd::nothing_received;
    print(draw_screen(feed_.view(), monotonic_ns(), screen_).to_text());
    return WatchEnd::quit;
  }

 private:
  /// Receives messages until `until_ns`, a key or a signal. Returns true if the terminal was closed.
  bool wait(std::int64_t until_ns, bool keys) {
    const std::int64_t left_ms = (until_ns - monotonic_ns() + rig::ns_per_ms - 1) / rig::ns_per_ms;
    std::array<pollfd, 2> ready{pollfd{listener_.file_descriptor(), POLLIN, 0}, pollfd{STDIN_FILENO, POLLIN, 0}};
    const auto timeout_ms = static_cast<int>(std::clamp<std::int64_t>(left_ms, 0, draw_period_ns / rig::ns_per_ms));
    if (::poll(ready.data(), keys ? 2 : 1, timeout_ms) < 0) return false;  // EINTR: the caller checks for signals
    // Also polls without a descriptor (a tcpq server is away): LCM then tries to reconnect.
    if (ready[0].fd < 0 || ready[0].revents != 0) listener_.poll();
    return keys && (ready[1].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0;
  }

  /// Returns false if nobody reads the output any more.
  static bool print(const std::string& text) {
    return std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  }

  const WatchOptions& options_;
  const std::function<bool()>& stop_;
  ViewFeed feed_;
  telemetry::RunListener listener_;
  ScreenOptions screen_{};
};

}  // namespace

WatchEnd watch(const WatchOptions& options, const std::function<bool()>& stop) {
  if (!(options.window_s >= 1.0 && options.window_s <= 60.0)) {
    throw std::invalid_argument(fmt::format("--window {}: must be in [1, 60] s", options.window_s));
  }
  if (!(options.once_timeout_s > 0.0)) {
    throw std::invalid_argument(fmt::format("--timeout {}: must be above 0 s", options.once_timeout_s));
  }
  Session session(options, stop);
  if (options.once) return session.one_picture();
  return options.plain || !is_terminal() ? session.in_lines() : session.on_terminal();
}

}  // namespace abs_hil::watch
