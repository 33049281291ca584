#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/axis.hpp"
#include "report/gnuplot.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

constexpr double width_px = 760.0;
constexpr double left_px = 78.0;
constexpr double right_px = 18.0;
constexpr double bottom_px = 52.0;
constexpr double gap_px = 16.0;
constexpr double log_gap_px = 22.0;  ///< powers of ten need more height
constexpr double own_axis_gap_px = 54.0;
constexpr double legend_row_px = 21.5;  ///< gnuplot's spacing of legend rows
constexpr double label_row_px = 17.0;
constexpr double top_px = 8.0;
constexpr double font_px = 14.0;
constexpr double small_font_px = 12.0;
constexpr double legend_character_px = 8.4;  ///< gnuplot's estimate for the layout of a legend
constexpr double small_character_px = 5.8;   ///< of the small font
constexpr double legend_sample_px = 94.0;
constexpr double inner_px = width_px - left_px - right_px;
constexpr int x_marks = 8;

using Lines = std::string;

template <typename... Args>
void say(Lines& script, fmt::format_string<Args...> format, Args&&... args) {
  fmt::format_to(std::back_inserter(script), format, std::forward<Args>(args)...);
  script += '\n';
}

double gap_below(const Panel& panel) {
  if (panel.x_range) return own_axis_gap_px;
  return panel.log_y ? log_gap_px : gap_px;
}

/// Vertical positions of all parts, in pixels from the top.
struct Layout {
  explicit Layout(const Figure& figure) {
    std::size_t longest = 1;
    for (const LegendEntry& entry : figure.legend) longest = std::max(longest, length_of(entry.text));
    const double entry_px = static_cast<double>(longest) * legend_character_px + legend_sample_px;
    columns = std::max<std::size_t>(1, static_cast<std::size_t>(inner_px / entry_px));
    columns = std::max<std::size_t>(1, std::min(columns, figure.legend.size()));
    const std::size_t rows = (figure.legend.size() + columns - 1) / columns;
    labels_px = top_px + static_cast<double>(rows) * legend_row_px;
    double at_px = labels_px + (figure.shades.empty() && figure.marks.empty() ? 4.0 : label_row_px);
    for (std::size_t i = 0; i < figure.panels.size(); ++i) {
      if (i > 0) at_px += gap_below(figure.panels[i - 1]);
      tops_px.push_back(at_px);
      at_px += figure.panels[i].height_px;
    }
    height_px = at_px + bottom_px;
  }
  [[nodiscard]] double screen_y(double from_top_px) const { return 1.0 - from_top_px / height_px; }

  std::size_t columns{1};
  double labels_px{0.0};
  std::vector<double> tops_px{};
  double height_px{0.0};
};

std::string line_style(const Style& style) {
  return fmt::format("lw {} dt {} lc rgb {}", style.width, style.dash == "solid" ? "1" : style.dash,
                     gnuplot_quote(style.colour));
}

std::string with(const Style& style, Drawn drawn) {
  const std::string markers = fmt::format("pt {} ps 0.55 lc rgb {}", style.point_type, gnuplot_quote(style.colour));
  switch (drawn) {
    case Drawn::line: return "with lines " + line_style(style);
    case Drawn::markers: return "with points " + markers;
    case Drawn::intervals: return "with yerrorbars lw 1.2 " + markers;
  }
  return {};
}

void add_terminal(Lines& script, const Figure& figure, const Layout& layout, PictureFormat format) {
  const double height = layout.height_px;
  constexpr std::string_view font = "Liberation Serif";
  switch (format) {
    case PictureFormat::svg:
      say(script, "set terminal svg size {},{:.0f} dynamic font '{},{}' name '{}'", width_px, height, font, font_px,
          figure.id);
      break;
    case PictureFormat::png:
      say(script, "set terminal pngcairo size {},{:.0f} font '{},{}' fontscale 1.5 linewidth 2 background 'white'",
          2.0 * width_px, 2.0 * height, font, font_px);
      break;
    case PictureFormat::pdf:
      say(script, "set terminal pdfcairo size {:.3f}in,{:.3f}in font '{},{}' linewidth 1.2", width_px / 96.0,
          height / 96.0, font, 0.75 * font_px);
      break;
  }
  say(script, "set output '{}.{}'", figure.id, extension_of(format));
}

void add_data(Lines& script, std::size_t figure, std::size_t panel, const Panel& p) {
  for (std::size_t c = 0; c < p.curves.size(); ++c) {
    const Curve& curve = p.curves[c];
    say(script, "$d{}_{}_{} << EOD", figure, panel, c);
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      const Point& point = curve.points[i];
      if (std::isnan(point.y)) {
        say(script, "{:.9g} NaN", point.x);
      } else if (curve.drawn == Drawn::intervals) {
        say(script, "{:.9g} {:.7g} {:.7g} {:.7g}", point.x, point.y, curve.bounds[i].first, curve.bounds[i].second);
      } else {
        say(script, "{:.9g} {:.7g}", point.x, point.y);
      }
    }
    say(script, "EOD");
  }
}

/// Labels phases and marks in the row above the frame, as many as fit; marks have priority.
void add_row_of_labels(Lines& script, const Figure& figure, Range x, double above) {
  const double px_a_unit = inner_px / (x.second - x.first);
  std::vector<Range> taken;
  const auto place = [&](double at, const std::string& text, const char* colour, double room_px) {
    const double half_px = 0.5 * static_cast<double>(length_of(text)) * small_character_px + 3.0;
    double at_px = (at - x.first) * px_a_unit;
    if (2.0 * half_px > room_px || at_px < 0.0 || at_px > inner_px) return;
    at_px = std::clamp(at_px, half_px, inner_px - half_px);
    for (const Range& other : taken) {
      if (at_px - half_px < other.second && at_px + half_px > other.first) return;
    }
    taken.emplace_back(at_px - half_px, at_px + half_px);
    say(script, "set label {} at graph {:.5f},{:.5f} center noenhanced font ',{}' tc rgb '{}'", gnuplot_quote(text),
        at_px / inner_px, above, small_font_px, colour);
  };
  for (const Mark& mark : figure.marks) place(mark.x, mark.label, mark.fault ? "#A03000" : "#404040", inner_px);
  for (const Shade& shade : figure.shades) {
    const double from = std::max(shade.from, x.first);
    const double to = std::min(shade.to, x.second);
    place(0.5 * (from + to), shade.label, "#606060", (to - from) * px_a_unit);
  }
}

void add_background(Lines& script, const Figure& figure, const Panel& panel, Range x) {
  if (!panel.x_range) {
    for (const Shade& shade : figure.shades) {
      if (shade.to <= x.first || shade.from >= x.second) continue;
      say(script, "set object rect from {:.9g},graph 0 to {:.9g},graph 1 behind fc rgb '{}' fs solid noborder",
          std::max(shade.from, x.first), std::min(shade.to, x.second), phase_colour(shade.label));
    }
    for (const Mark& mark : figure.marks) {
      if (mark.x < x.first || mark.x > x.second) continue;
      say(script, "set arrow from {:.9g},graph 0 to {:.9g},graph 1 nohead lw 1 dt (4,3) lc rgb '{}'", mark.x, mark.x,
          mark.fault ? "#D55E00" : "#909090");
    }
  }
  const double px_a_unit = inner_px / (x.second - x.first);
  for (const Bar& bar : panel.bars) {
    const double from = std::max(bar.x0, x.first);
    const double to = std::min(bar.x1, x.second);
    if (to <= from) continue;
    say(script, "set object rect from {:.9g},{:.9g} to {:.9g},{:.9g} fc rgb '{}' fs solid border lc rgb '#808080'",
        from, bar.y0, to, bar.y1, bar.colour);
    if (static_cast<double>(length_of(bar.text)) * small_character_px + 4.0 > (to - from) * px_a_unit) continue;
    say(script, "set label {} at {:.9g},{:.9g} center noenhanced front font ',{}' tc rgb '#303030'",
        gnuplot_quote(bar.text), 0.5 * (from + to), 0.5 * (bar.y0 + bar.y1), small_font_px);
  }
}

void add_tics(Lines& script, char axis, const std::vector<std::pair<double, std::string>>& tics) {
  std::string list;
  for (const auto& [at, text] : tics) {
    list += fmt::format("{}{} {:.9g}", list.empty() ? "" : ", ", gnuplot_quote(text), at);
  }
  say(script, "set {}tics noenhanced font ',{}' ({})", axis, small_font_px, list);
}

void add_axes(Lines& script, const Panel& panel, Range x, bool labelled, const std::string& x_label) {
  if (panel.log_x) {
    say(script, "set logscale x; set format x '10^{{%T}}'; set xtics 10 enhanced font ''; set xrange [{:.9g}:{:.9g}]",
        x.first, x.second);
  } else {
    const Axis axis = axis_within(x, x_marks);
    say(script, "unset logscale x; set format x '%g'; set xtics {:.9g} enhanced font ''; set xrange [{:.9g}:{:.9g}]",
        axis.step, axis.low, axis.high);
  }
  if (!panel.x_tics.empty()) add_tics(script, 'x', panel.x_tics);
  if (!labelled) say(script, "set format x ''");
  say(script, "set xlabel {} offset 0,0.7", gnuplot_quote(labelled ? x_label : ""));
  const Range y = panel.y_range.value_or(values_within(panel, x));
  if (panel.log_y) {
    say(script,
        "set logscale y; set format y '10^{{%T}}'; set ytics 10 enhanced font ''; set mytics 1; set yrange "
        "[{:.9g}:{:.9g}]",
        y.first, y.second);
  } else {
    const int wanted = std::max(2, static_cast<int>(panel.height_px / px_a_mark));
    const Axis axis = panel.y_range ? axis_within(y, wanted) : axis_around(y, wanted);
    say(script, "unset logscale y; set format y '%g'; set ytics {:.9g} enhanced font ''; set yrange [{:.9g}:{:.9g}]",
        axis.step, axis.low, axis.high);
  }
  if (!panel.y_tics.empty()) add_tics(script, 'y', panel.y_tics);
  say(script, "set ylabel {} offset 0.6,0", gnuplot_quote(panel.y_label));
  script += panel.grid ? "set grid back lt 1 lw 0.6 lc rgb '#d8d8d8'\n" : "unset grid\n";
}

void add_plot(Lines& script, const Figure& figure, std::size_t f, std::size_t p, const Layout& layout) {
  const Panel& panel = figure.panels[p];
  Lines plots;
  // The first curve is drawn last: it lies on top.
  for (std::size_t c = panel.curves.size(); c-- > 0;) {
    const Curve& curve = panel.curves[c];
    plots += fmt::format("{}$d{}_{}_{} using 1:2{} {} notitle", plots.empty() ? "" : ", \\\n  ", f, p, c,
                         curve.drawn == Drawn::intervals ? ":3:4" : "", with(curve.style, curve.drawn));
  }
  if (plots.empty()) plots = "NaN notitle";  // draws an empty frame
  if (p == 0 && !figure.legend.empty()) {
    say(script, "set key noenhanced at screen 0.5,{:.5f} center top horizontal maxcols {} samplen 3.2 height 0 width 1",
        layout.screen_y(2.0), layout.columns);
    for (const LegendEntry& entry : figure.legend) {
      plots += fmt::format(", \\\n  keyentry {} title {}", with(entry.style, entry.drawn), gnuplot_quote(entry.text));
    }
  } else {
    say(script, "unset key");
  }
  say(script, "plot {}", plots);
}

void add_figure(Lines& script, const Figure& figure, std::size_t f, PictureFormat format) {
  const Layout layout(figure);
  say(script, "reset");
  say(script, "set minussign; set border lw 0.8; set tics scale 0.6 nomirror; set datafile missing 'missing'");
  for (std::size_t p = 0; p < figure.panels.size(); ++p) add_data(script, f, p, figure.panels[p]);
  add_terminal(script, figure, layout, format);
  say(script, "set multiplot");
  say(script, "set lmargin at screen {:.5f}; set rmargin at screen {:.5f}", left_px / width_px,
      1.0 - right_px / width_px);
  for (std::size_t p = 0; p < figure.panels.size(); ++p) {
    const Panel& panel = figure.panels[p];
    const Range x = panel.x_range.value_or(figure.x_range.value_or(Range{0.0, 1.0}));
    const bool last = p + 1 == figure.panels.size();
    say(script, "unset object; unset label; unset arrow");
    say(script, "set tmargin at screen {:.5f}; set bmargin at screen {:.5f}", layout.screen_y(layout.tops_px[p]),
        layout.screen_y(layout.tops_px[p] + panel.height_px));
    add_background(script, figure, panel, x);
    if (p == 0 && !panel.x_range) add_row_of_labels(script, figure, x, 1.0 + 9.0 / panel.height_px);
    if (figure.panels.size() > 1) {
      say(script, "set label '({})' at screen {:.5f},{:.5f} left font ',{}'", static_cast<char>('a' + p),
          4.0 / width_px, layout.screen_y(layout.tops_px[p] + 2.0), font_px);
    }
    add_axes(script, panel, x, last || panel.x_range.has_value(), panel.x_range ? panel.x_label : figure.x_label);
    add_plot(script, figure, f, p, layout);
  }
  say(script, "unset multiplot\nset output");
}

}  // namespace

std::string_view extension_of(PictureFormat format) {
  switch (format) {
    case PictureFormat::svg: return "svg";
    case PictureFormat::png: return "png";
    case PictureFormat::pdf: return "pdf";
  }
  return "svg";
}

std::string gnuplot_script(const std::vector<Figure>& figures, PictureFormat format) {
  Lines script = "set encoding utf8\n";
  for (std::size_t f = 0; f < figures.size(); ++f) add_figure(script, figures[f], f, format);
  return script;
}

}  // namespace abs_hil::report
