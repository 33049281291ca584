#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report/decimation.hpp"

namespace abs_hil::report {

/// How a curve is drawn. Dashes distinguish curves where there are no colours.
struct Style {
  std::string colour{"#000000"};
  std::string dash{"solid"};  ///< gnuplot's: "solid" or "(10,4)"
  double width{1.4};
  int point_type{7};  ///< gnuplot's, for markers
};

/// Okabe and Ito's palette for colour-blind readers without its yellow. Each entry has its own dash pattern.
[[nodiscard]] Style run_style(std::size_t run);

enum class Drawn { line, markers, intervals };

struct Curve {
  std::size_t run{0};
  std::string quantity{};  ///< the column that it shows, or a name for a computed quantity
  Style style{};
  std::vector<Point> points{};
  Drawn drawn{Drawn::line};
  /// For Drawn::intervals: lower and upper bound of every point.
  std::vector<std::pair<double, double>> bounds{};
};

struct LegendEntry {
  std::string text{};  ///< plain text
  Style style{};
  Drawn drawn{Drawn::line};
};

using Range = std::pair<double, double>;

/// A rectangle in a panel's coordinates that shows a phase of a run.
struct Bar {
  double x0{0.0};
  double x1{0.0};
  double y0{0.0};
  double y1{0.0};
  std::string colour{};
  std::string text{};  ///< shown in the middle if it fits
};

struct Panel {
  std::string y_label{};  ///< in gnuplot's enhanced notation; fixed text, never from a file
  std::optional<Range> y_range{};
  std::vector<Curve> curves{};
  double height_px{180.0};
  bool log_x{false};
  bool log_y{false};
  std::optional<Range> x_range{};                        ///< if set, the panel has its own x axis
  std::string x_label{};                                 ///< for x_range; enhanced notation, fixed text
  std::vector<std::pair<double, std::string>> y_tics{};  ///< instead of numbers; plain text
  std::vector<std::pair<double, std::string>> x_tics{};  ///< instead of numbers; plain text
  std::vector<Bar> bars{};
  bool grid{true};
};

/// A shaded part of the time axis.
struct Shade {
  double from{0.0};
  double to{0.0};
  std::string label{};  ///< plain text
};

/// A vertical line at an instant.
struct Mark {
  double x{0.0};
  std::string label{};  ///< plain text
  bool fault{false};
};

/// A picture of one or more panels in a column with a common x axis.
struct Figure {
  std::string id{};       ///< "fig5": names its file and its curves; `fig5_1a` is the first curve of panel a
  std::string heading{};  ///< plain text: "Figure 5. Upper wheel speed"
  std::string caption{};  ///< plain text
  std::string x_label{};  ///< enhanced notation, fixed text
  std::optional<Range> x_range{};
  std::vector<Panel> panels{};
  std::vector<LegendEntry> legend{};
  std::vector<Shade> shades{};
  std::vector<Mark> marks{};
};

/// Background colour of a phase; white for braking, the phase of interest.
[[nodiscard]] std::string phase_colour(const std::string& phase);

}  // namespace abs_hil::report
