#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "report/gnuplot.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

void replace_all(std::string& text, std::string_view what, std::string_view with) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + with.size())) {
    text.replace(at, what.size(), with);
  }
}

std::size_t points_of(const Curve& curve) {
  std::size_t count = 0;
  for (const Point& point : curve.points) count += std::isnan(point.y) ? 0 : 1;
  return count;
}

/// gnuplot opens each plot with `<g id="fig5_plot_2a" ><title>...</title>`; this replaces it.
void mark_plot(std::string& svg, const std::string& gnuplot_id, const std::string& opening) {
  const std::size_t begin = svg.find(fmt::format("<g id=\"{}\"", gnuplot_id));
  const std::size_t end = begin == std::string::npos ? begin : svg.find("</title>", begin);
  if (end == std::string::npos)
    throw std::runtime_error(fmt::format("gnuplot's picture has no element {}", gnuplot_id));
  svg.replace(begin, end - begin, opening);
}

}  // namespace

std::string with_common_fonts(std::string svg) {
  replace_all(svg, "font-family=\"Liberation Serif\"", "font-family=\"Liberation Serif,Times New Roman,Times,serif\"");
  return svg;
}

std::string embeddable_svg(const std::string& picture, const Figure& figure) {
  const std::size_t begin = picture.find("<svg");
  if (begin == std::string::npos) throw std::runtime_error("gnuplot's picture is not an SVG");
  std::string svg = with_common_fonts(picture.substr(begin));
  for (std::size_t p = 0; p < figure.panels.size(); ++p) {
    const std::vector<Curve>& curves = figure.panels[p].curves;
    const char letter = static_cast<char>('a' + p);
    for (std::size_t c = 0; c < curves.size(); ++c) {
      const Curve& curve = curves[c];
      mark_plot(svg, fmt::format("{}_plot_{}{}", figure.id, curves.size() - c, letter),
                fmt::format("<g id=\"{}_{}{}\" class=\"curve\" data-run=\"{}\" data-quantity=\"{}\" "
                            "data-points=\"{}\"><title>{}",
                            figure.id, c + 1, letter, curve.run + 1, html_escape(curve.quantity), points_of(curve),
                            html_escape(curve.quantity)));
    }
  }
  for (std::size_t i = 0; i < figure.legend.size(); ++i) {
    const std::size_t before = figure.panels.front().curves.empty() ? 1 : figure.panels.front().curves.size();
    mark_plot(svg, fmt::format("{}_plot_{}a", figure.id, before + i + 1),
              fmt::format("<g class=\"legend\"><title>{}", html_escape(figure.legend[i].text)));
  }
  replace_all(svg, "gpPt", figure.id + "_point");
  replace_all(svg, "gnuplot_canvas", figure.id + "_canvas");
  svg.replace(0, 4,
              fmt::format("<svg id=\"{}\" role=\"img\" aria-label=\"{}\"", figure.id, html_escape(figure.heading)));
  return svg;
}

}  // namespace abs_hil::report
