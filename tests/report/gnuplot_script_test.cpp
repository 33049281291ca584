#include <sstream>

#include "catch.hpp"
#include "report/gnuplot.hpp"

using namespace abs_hil::report;

namespace {

Figure figure_with(const std::string& text) {
  Figure figure;
  figure.id = "fig";
  figure.heading = text;
  figure.x_range = Range{0.0, 1.0};
  figure.legend = {{text, {}, Drawn::line}};
  figure.shades = {{0.0, 1.0, text}};
  figure.marks = {{0.5, text, true}};
  Panel panel;
  panel.y_tics = {{0.5, text}};
  panel.bars = {{0.0, 1.0, 0.0, 1.0, "#ffffff", text}};
  panel.curves = {{0, text, {}, {{0.0, 0.0}, {1.0, 1.0}}, Drawn::line, {}}};
  figure.panels = {panel};
  return figure;
}

/// The parts of a script outside gnuplot's single quotes.
std::string unquoted(const std::string& script) {
  std::string rest;
  bool quoted = false;
  for (const char c : script) {
    if (c == '\'') {
      quoted = !quoted;
    } else if (!quoted) {
      rest += c;
    }
  }
  return rest;
}

}  // namespace

TEST_CASE("Text from files is always within single quotes") {
  const std::string hostile = "'; system('touch pwned') #`id`\"$(id)\" @x";
  const std::string rest = unquoted(gnuplot_script({figure_with(hostile)}, PictureFormat::svg));
  for (const char* part : {"system", "`", "\"", "touch", "$(", "@x"}) {
    INFO(part);
    CHECK(rest.find(part) == std::string::npos);
  }
}

TEST_CASE("A picture's curves are marked, and hostile names stay text") {
  const Figure figure = figure_with("<b onload=\"x\">");
  const std::string drawn =
      "<?xml version=\"1.0\"?>\n<!DOCTYPE svg>\n<svg viewBox=\"0 0 1 1\"><g id=\"gnuplot_canvas\">"
      "<g id=\"fig_plot_1a\" ><title>fig_plot_1a</title><path d='M0,0 L1,1'/></g>"
      "<g id=\"fig_plot_2a\" ><title>&lt;b></title></g></g></svg>";
  const std::string svg = embeddable_svg(drawn, figure);
  CHECK(svg.find("<svg id=\"fig\" role=\"img\"") == 0);
  CHECK(svg.find("<b ") == std::string::npos);
  CHECK(svg.find("class=\"curve\" data-run=\"1\" data-quantity=\"&lt;b onload=&quot;x&quot;&gt;\" data-points=\"2\"") !=
        std::string::npos);
  CHECK(svg.find("<g class=\"legend\"><title>&lt;b onload") != std::string::npos);
  CHECK_THROWS(embeddable_svg("gnuplot died", figure));
  CHECK_THROWS(embeddable_svg("<svg></svg>", figure));
}
