#include "watch/screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>
#include <vector>

#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/reason.hpp"
#include "watch/plot.hpp"

namespace abs_hil::watch {
namespace {

constexpr double silent_after_s = 1.5;  // ABS_STATUS comes every second
constexpr int axis_columns = 8;
constexpr int plot_rows_min = 3;  // the title and two rows of dots

/// Characters beyond ASCII and their ASCII replacements.
struct Words {
  std::string_view omega1, omega2, theta_est, theta, micro, dot;
};
constexpr Words unicode_words{"ω1", "ω2", "θ̂", "θ", "µs", " · "};
constexpr Words ascii_words{"w1", "w2", "theta", "theta", "us", ", "};

const Words& words_of(const ScreenOptions& options) { return options.unicode ? unicode_words : ascii_words; }

rig::Phase phase_of(std::int8_t number) {
  const bool valid = number >= telemetry_t::PHASE_IDLE && number <= telemetry_t::PHASE_FAULT;
  return valid ? static_cast<rig::Phase>(number) : rig::Phase::fault;
}

bool has_ended(const RunView& view) {
  const auto& telemetry = view.telemetry();
  if (!telemetry) return false;
  const rig::Phase phase = phase_of(telemetry->phase);
  return phase == rig::Phase::stopped || phase == rig::Phase::fault;
}

Style style_of(rig::Phase phase) {
  if (phase == rig::Phase::fault) return Style::alarm;
  return phase == rig::Phase::brake ? Style::good : Style::bold;
}

/// A number in few characters; "-" for NaN. The value comes from the network and may be any double.
std::string number(double value, int decimals) {
  if (std::isnan(value)) return "-";
  return std::abs(value) < 1e6 ? fmt::format("{:.{}f}", value, decimals) : fmt::format("{:.1e}", value);
}

std::string quantiles(double p50, double p99, double p99_9, double max) {
  return fmt::format("{}/{}/{}/{}", number(p50, 0), number(p99, 0), number(p99_9, 0), number(max, 0));
}

/// "1000 messages/s", "no messages for 3.2 s", "waiting for messages".
std::string liveness(const RunView& view, std::int64_t now_ns) {
  const auto silence_s = view.silence_s(now_ns);
  if (!silence_s) return "waiting for messages";
  if (*silence_s >= silent_after_s) {
    return fmt::format("{}no messages for {:.1f} s", has_ended(view) ? "run ended, " : "", *silence_s);
  }
  return fmt::format("{} messages/s", view.messages_last_second(now_ns));
}

bool is_silent(const RunView& view, std::int64_t now_ns) {
  return view.silence_s(now_ns).value_or(silent_after_s) >= silent_after_s;
}

std::string values_text(const RunView& view, const Words& words) {
  const Sample& s = view.samples().back();
  return fmt::format("{} {:>5} {} {:>5} rad/s  slip {:>6}/{:<5}  {} {:>6} N", words.omega1, number(s.omega1_rad_s, 1),
                     words.omega2, number(s.omega2_rad_s, 1), number(s.slip, 3), number(s.slip_ref, 3), words.theta_est,
                     number(s.theta_est_N, 2));
}

/// Why the run ended in a fault: from the event or, if that was lost, from the reason in the telemetry.
std::string fault_text(const RunView& view) {
  for (const event_t& event : view.events()) {
    if (event.kind == "fault") return event.message.empty() ? event.reason_text : event.message;
  }
  const auto& telemetry = view.telemetry();
  const auto reason = telemetry ? static_cast<rig::Reason>(telemetry->reason) : rig::Reason::none;
  return reason == rig::Reason::none ? "reason not received" : std::string(rig::description(reason));
}

class Screen {
 public:
  Screen(const RunView& view, std::int64_t now_ns, const ScreenOptions& options)
      : view_(view),
        now_ns_(now_ns),
        options_(options),
        words_(words_of(options)),
        grid_(options.columns, options.rows) {}

  CellGrid draw() {
    draw_head();
    if (!view_.telemetry() && !view_.status()) {
      draw_waiting();
    } else {
      draw_state();
      draw_plots(draw_foot());
    }
    if (grid_.rows() > 3) grid_.write(0, grid_.rows() - 1, "q quits", Style::dim);
    return std::move(grid_);
  }

 private:
  void draw_head() {
    const int column = grid_.write(0, 0, "abs_hil watch  ", Style::bold);
    if (const auto& e = view_.experiment()) {
      grid_.write(column, 0,
                  fmt::format("{}{}{}{}{}{}{}", e->experiment, words_.dot, e->controller, words_.dot, e->plant,
                              words_.dot, e->backend));
    }
    const std::string text = liveness(view_, now_ns_);
    // Overwrite the names if there is no room for both.
    const int at = std::max(0, grid_.columns() - columns_of(text));
    grid_.write(at - 2, 0, "  ");
    const Style silent = has_ended(view_) ? Style::dim : Style::alarm;
    grid_.write(at, 0, text, is_silent(view_, now_ns_) ? silent : Style::good);
  }

  void draw_waiting() {
    grid_.write(0, 2, fmt::format("No message has arrived yet on {} at {}.", options_.channel, options_.source));
    grid_.write(0, 3, "Start a run:  abs_hil", Style::dim);
    grid_.write(0, 4, "By default messages stay on one computer. To receive from another one, give both", Style::dim);
    grid_.write(0, 5, "programs --lcm-url udpm://239.255.76.67:7667?ttl=1", Style::dim);
    draw_malformed(6);
  }

  void draw_malformed(int row) {
    if (view_.malformed() == 0) return;
    grid_.write(0, row, fmt::format("{} packets had no message type of abs_hil", view_.malformed()), Style::alarm);
  }

  void draw_state() {
    const auto& telemetry = view_.telemetry();
    const auto& status = view_.status();
    std::int8_t number_of_phase = telemetry_t::PHASE_IDLE;
    double time_s = 0.0;
    if (telemetry) {
      number_of_phase = telemetry->phase;
      time_s = telemetry->time_s;
    } else if (status) {
      number_of_phase = status->phase;
      time_s = status->time_s;
    }
    const rig::Phase phase = phase_of(number_of_phase);
    int column = grid_.write(0, 1, view_.name_of(phase), style_of(phase));
    column = grid_.write(std::max(column + 1, 11), 1, fmt::format("{:>7} s  ", number(time_s, 3)), Style::bold);
    if (phase == rig::Phase::fault && telemetry) {
      grid_.write(column, 1, fault_text(view_), Style::alarm);
    } else if (!view_.samples().empty()) {
      grid_.write(column, 1, values_text(view_, words_));
    }
  }

  /// Draws timing, counts and events at the bottom. Returns the first row of these.
  int draw_foot() {
    const int events = std::clamp(grid_.rows() - 20, 1, 6);
    const int first = std::max(2, grid_.rows() - 1 - events - 2);
    const bool has_signals = !view_.values().empty() && first > 2;
    if (has_signals) draw_signals(first - 1);
    draw_timing(first);
    draw_counts(first + 1);
    const auto& all = view_.events();
    const int shown = std::min(events, static_cast<int>(all.size()));
    for (int i = 0; i < shown; ++i) {
      const event_t& event = all[static_cast<std::size_t>(shown - 1 - i)];
      const std::string& text = event.message.empty() ? event.reason_text : event.message;
      grid_.write(0, first + 2 + i, fmt::format("{:>8} s {:8} {}", number(event.time_s, 3), event.kind, text),
                  event.kind == "fault" ? Style::alarm : Style::normal);
    }
    return has_signals ? first - 1 : first;
  }

  /// Draws the controller's own signals, as many as there is room for.
  void draw_signals(int row) {
    int column = 0;
    for (const NamedValue& signal : view_.values()) {
      column = grid_.write(column, row, fmt::format("{} {}  ", signal.name, number(signal.value, 4)));
    }
  }

  void draw_timing(int row) {
    const auto& s = view_.status();
    if (!s) {
      grid_.write(0, row, "timing: no status received yet", Style::dim);
      return;
    }
    grid_.write(
        0, row,
        fmt::format("wake-up {} cycle {} {}, p50/p99/p99.9/max{}",
                    quantiles(s->wakeup_latency_p50_us, s->wakeup_latency_p99_us, s->wakeup_latency_p99_9_us,
                              s->wakeup_latency_max_us),
                    quantiles(s->cycle_time_p50_us, s->cycle_time_p99_us, s->cycle_time_p99_9_us, s->cycle_time_max_us),
                    words_.micro, s->realtime != 0 ? "" : "  NOT IN REAL TIME"),
        s->realtime != 0 ? Style::normal : Style::alarm);
  }

  /// Draws the error counts; a count above 0 is highlighted.
  void draw_counts(int row) {
    int column = 0;
    const auto count = [&](std::string_view name, std::int64_t value) {
      column =
          grid_.write(column, row, fmt::format("{} {}", name, value), value != 0 ? Style::alarm : Style::normal) + 2;
    };
    if (const auto& s = view_.status()) {
      count("overruns", s->overruns);
      count("drops", s->telemetry_drops);
      count("unpublished", s->publish_failures);
    }
    count("lost on the way", view_.lost());
    if (view_.malformed() != 0) count("malformed", view_.malformed());
    if (view_.runs() > 1) grid_.write(column, row, fmt::format("run {} seen here", view_.runs()), Style::dim);
  }

  void draw_plots(int end_row) {
    constexpr int first_row = 2;
    if (view_.samples().empty()) return;
    const int rows = end_row - first_row - 1;  // one row is for the time axis
    const int plots = std::clamp(rows / plot_rows_min, 0, 3);
    const int columns = grid_.columns() - axis_columns;
    if (plots == 0 || columns < 4) return;

    const std::array slip{PlotLine{&Sample::slip_ref, Style::second_line, '-'}, PlotLine{&Sample::slip}};
    const std::array speeds{PlotLine{&Sample::omega2_rad_s, Style::second_line, '+'}, PlotLine{&Sample::omega1_rad_s}};
    const std::array theta{PlotLine{&Sample::theta_N, Style::second_line, '-'}, PlotLine{&Sample::theta_est_N}};
    const std::string theta_title = fmt::format("{}, N", words_.theta_est);
    const std::string theta_other = fmt::format("true {}", words_.theta);
    const std::array all{Plot{"slip", "slip", "wanted", slip, {0.0, 0.3}, {-0.2, 1.0}},
                         Plot{"speeds, rad/s", words_.omega1, words_.omega2, speeds, {0.0, 10.0}, {-1e6, 1e6}},
                         Plot{theta_title, words_.theta_est, theta_other, theta, {0.0, 10.0}, {-1e6, 1e6}}};
    int row = first_row;
    for (int i = 0; i < plots; ++i) {
      const int height = (rows - (row - first_row)) / (plots - i);
      draw_one(all[static_cast<std::size_t>(i)], row, height, columns);
      row += height;
    }
    draw_time_axis(row, columns);
  }

  struct Plot {
    std::string_view title, first, second;
    std::span<const PlotLine> lines;  ///< in drawing order: the first quantity comes last, on top
    ValueRange least, most;
  };

  void draw_one(const Plot& plot, int row, int height, int columns) {
    int column = grid_.write(axis_columns, row, plot.title, Style::bold) + 2;
    const Sample& last = view_.samples().back();
    const auto legend = [&](std::string_view name, const PlotLine& line) {
      const std::string mark = options_.unicode ? std::string("━") : std::string(1, line.mark);
      column =
          grid_.write(column, row, fmt::format("{} {} {}", mark, name, number(last.*line.value, 3)), line.style) + 2;
    };
    legend(plot.first, plot.lines[1]);
    legend(plot.second, plot.lines[0]);
    const Area area{axis_columns, row + 1, columns, height - 1};
    const ValueRange range = range_of(view_.samples(), plot.lines, plot.least, plot.most);
    draw_plot(grid_, area, view_.samples(), plot.lines, range, last.time_s, view_.window_s(), options_.unicode);
    const int decimals = range.high - range.low < 5.0 ? 2 : 0;
    label(area.row, number(range.high, decimals));
    label(area.row + area.rows - 1, number(range.low, decimals));
  }

  void label(int row, const std::string& text) {
    grid_.write(std::max(axis_columns - 1 - columns_of(text), 0), row, text, Style::dim);
  }

  void draw_time_axis(int row, int columns) {
    const std::string now = "now";
    const std::string middle = fmt::format("-{:g} s", view_.window_s() / 2.0);
    grid_.write(axis_columns, row, fmt::format("-{:g} s", view_.window_s()), Style::dim);
    grid_.write(axis_columns + columns / 2 - columns_of(middle) / 2, row, middle, Style::dim);
    grid_.write(axis_columns + columns - columns_of(now), row, now, Style::dim);
  }

  const RunView& view_;
  std::int64_t now_ns_;
  const ScreenOptions& options_;
  const Words& words_;
  CellGrid grid_;
};

}  // namespace

CellGrid draw_screen(const RunView& view, std::int64_t now_ns, const ScreenOptions& options) {
  return Screen(view, now_ns, options).draw();
}

std::string one_line(const RunView& view, std::int64_t now_ns, const ScreenOptions& options) {
  std::string live = liveness(view, now_ns);
  const auto& telemetry = view.telemetry();
  if (!telemetry) return live;
  const rig::Phase phase = phase_of(telemetry->phase);
  std::string line = fmt::format("{:10} {:>7} s", view.name_of(phase), number(telemetry->time_s, 3));
  if (phase == rig::Phase::fault) line += "  " + fault_text(view);
  if (!view.samples().empty()) line += "  " + values_text(view, words_of(options));
  if (const auto& s = view.status()) line += fmt::format("  overruns {}  drops {}", s->overruns, s->telemetry_drops);
  return line + fmt::format("  lost {}  {}", view.lost(), live);
}

}  // namespace abs_hil::watch
