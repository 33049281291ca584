#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report/decimation.hpp"

namespace abs_hil::report {

/// How a curve is drawn. Colours tell curves apart, dashes do too where there is no colour.
struct Style {
  std::string colour{"#000000"};
  std::string dash{"solid"};  ///< gnuplot's: "solid" or "(10,4)"
  double width{1.4};
  int point_type{7};  ///< gnuplot's, for markers
};

/// Okabe and Ito's palette, which the colour-blind can tell apart, yellow left out; every entry with a dash of its own.
[[nodiscard]] Style run_style(std::size_t run);

enum class Drawn { line, markers, intervals };

struct Curve {
  std::size_t run{0};
  std::string quantity{};  ///< column that it shows, or what is made of columns
  Style style{};
  std::vector<Point> points{};
  Drawn drawn{Drawn::line};
  /// With Drawn::intervals: low and high of every point.
  std::vector<std::pair<double, double>> bounds{};
};

struct LegendEntry {
  std::string text{};  ///< plain: shown as it is
  Style style{};
  Drawn drawn{Drawn::line};
};

using Range = std::pair<double, double>;

/// A rectangle of a panel, in its coordinates: a phase of a run.
struct Bar {
  double x0{0.0};
  double x1{0.0};
  double y0{0.0};
  double y1{0.0};
  std::string colour{};
  std::string text{};  ///< shown in its middle where there is room
};

struct Panel {
  std::string y_label{};  ///< in gnuplot's enhanced notation; ours, never from a file
  std::optional<Range> y_range{};
  std::vector<Curve> curves{};
  double height_px{180.0};
  bool log_x{false};
  bool log_y{false};
  std::optional<Range> x_range{};                        ///< unlike the figure's: the panel then has an axis of its own
  std::string x_label{};                                 ///< with x_range; enhanced notation, ours
  std::vector<std::pair<double, std::string>> y_tics{};  ///< instead of numbers; plain text
  std::vector<std::pair<double, std::string>> x_tics{};  ///< instead of numbers; plain text
  std::vector<Bar> bars{};
  bool grid{true};
};

/// A stretch of the time axis with a light background.
struct Shade {
  double from{0.0};
  double to{0.0};
  std::string label{};  ///< plain
};

/// A vertical line at an instant.
struct Mark {
  double x{0.0};
  std::string label{};  ///< plain
  bool fault{false};
};

/// A picture with one or more panels above each other that share their x axis.
struct Figure {
  std::string id{};       ///< "fig5": of its file and of its curves, `fig5_1a` is the first one of panel a
  std::string heading{};  ///< plain: "Figure 5. Upper wheel speed"
  std::string caption{};  ///< plain
  std::string x_label{};  ///< enhanced notation, ours
  std::optional<Range> x_range{};
  std::vector<Panel> panels{};
  std::vector<LegendEntry> legend{};
  std::vector<Shade> shades{};
  std::vector<Mark> marks{};
};

/// Background of a phase; white for what is looked at, braking.
[[nodiscard]] std::string phase_colour(const std::string& phase);

}  // namespace abs_hil::report
