#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "report/run_figures.hpp"

namespace abs_hil::report {

namespace {

constexpr double bins_a_decade = 10.0;
constexpr double panel_px = 105.0;
constexpr std::size_t most_runs = 7;
constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Lower edges, in whole us, of bins of about equal width on a logarithmic axis: 0, 1, 2, ...
std::vector<std::size_t> bin_edges(std::size_t last_us) {
  std::vector<std::size_t> edges{0, 1};
  for (double exponent = 0.0; edges.back() <= last_us; exponent += 1.0 / bins_a_decade) {
    const auto edge = static_cast<std::size_t>(std::lround(std::pow(10.0, exponent)));
    if (edge > edges.back()) edges.push_back(edge);
  }
  return edges;
}

double place_of(std::size_t edge_us) { return edge_us == 0 ? 0.5 : static_cast<double>(edge_us); }

/// Share of the cycles by duration as the outline of a bar chart; no outline over empty bins.
std::vector<Point> outline(const std::vector<std::uint64_t>& counts, double total, double floor) {
  std::vector<Point> points;
  const std::vector<std::size_t> edges = bin_edges(counts.size());
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const auto from = counts.begin() + static_cast<std::ptrdiff_t>(std::min(edges[i], counts.size()));
    const auto to = counts.begin() + static_cast<std::ptrdiff_t>(std::min(edges[i + 1], counts.size()));
    const double share = static_cast<double>(std::accumulate(from, to, std::uint64_t{0})) / total;
    const double left = place_of(edges[i]);
    const bool open = !points.empty() && !std::isnan(points.back().y);
    if (share <= 0.0) {
      if (open) points.insert(points.end(), {{left, floor}, {left, none}});
      continue;
    }
    if (!open) points.push_back({left, floor});
    points.push_back({left, share});
    points.push_back({place_of(edges[i + 1]), share});
  }
  if (!points.empty() && !std::isnan(points.back().y)) points.push_back({points.back().x, floor});
  if (!points.empty() && std::isnan(points.back().y)) points.pop_back();
  return points;
}

}  // namespace

std::optional<Figure> timing_figure(const std::vector<RunFiles>& runs) {
  Figure figure;
  figure.id = "timing";
  figure.heading = "Timing of the control cycle";
  std::vector<std::size_t> timed;
  for (std::size_t r = 0; r < runs.size() && timed.size() < most_runs; ++r) {
    if (runs[r].histogram) timed.push_back(r);
  }
  if (timed.empty()) return std::nullopt;

  double greatest_total = 1.0;
  std::size_t last_us = 10;
  for (const std::size_t r : timed) {
    for (const auto& counts : runs[r].histogram->counts) {
      greatest_total = std::max(greatest_total, std::accumulate(counts.begin(), counts.end(), 0.0));
      last_us = std::max(last_us, counts.size());
    }
  }
  const double floor = std::pow(10.0, std::floor(std::log10(0.9 / greatest_total)));
  const double x_high = std::pow(10.0, std::ceil(std::log10(static_cast<double>(last_us))));
  std::uint64_t overflows = 0;
  for (std::size_t part = 0; part < TimingHistogram::parts.size(); ++part) {
    Panel panel{.y_label = "share", .y_range = Range{floor, 1.0}};
    panel.height_px = panel_px;
    panel.log_x = panel.log_y = true;
    for (std::size_t i = 0; i < timed.size(); ++i) {
      const TimingHistogram& histogram = *runs[timed[i]].histogram;
      const auto& counts = histogram.counts[part];
      overflows += histogram.overflows[part];
      const double total = std::accumulate(counts.begin(), counts.end(), 0.0);
      if (total <= 0.0) continue;
      panel.curves.push_back({timed[i],
                              std::string(TimingHistogram::parts[part]),
                              run_style(timed[i]),
                              outline(counts, total, floor),
                              Drawn::line,
                              {}});
    }
    figure.panels.push_back(std::move(panel));
  }
  for (const std::size_t r : timed) figure.legend.push_back({runs[r].label, run_style(r), Drawn::line});
  figure.x_range = Range{0.5, x_high};
  figure.x_label = "duration / µs";
  figure.caption =
      "Share of the cycles by duration: (a) lateness of the wake-up, (b) reading the board, (c) control, (d) writing, "
      "(e) the whole cycle. Bins are about a tenth of a decade wide and hold whole microseconds; the first bin holds "
      "all "
      "durations below 1 µs. The axis ends below one cycle.";
  if (overflows > 0) {
    figure.caption += fmt::format(" {} durations beyond the histograms' range are not shown.", overflows);
  }
  return figure;
}

}  // namespace abs_hil::report
