#include "report/table.hpp"

#include <fmt/format.h>

#include "report/text.hpp"

namespace abs_hil::report {

std::string Table::html() const {
  std::string out = fmt::format("<div class=\"wide\"><table id=\"{}\"{}>\n<thead><tr>", html_escape(id),
                                numbers ? " class=\"numbers\"" : "");
  for (const std::string& cell : header) out += fmt::format("<th>{}</th>", html_escape(cell));
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : rows) {
    out += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string_view element = i == 0 ? "th" : "td";
      out += fmt::format("<{0}>{1}</{0}>", element, html_escape(row[i]));
    }
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

Table Table::turned() const {
  Table other{id, {header.empty() ? "" : header.front()}, {}, numbers};
  for (const auto& row : rows) other.header.push_back(row.front());
  for (std::size_t i = 1; i < header.size(); ++i) {
    std::vector<std::string> line{header[i]};
    for (const auto& row : rows) line.push_back(row[i]);
    other.rows.push_back(std::move(line));
  }
  return other;
}

}  // namespace abs_hil::report
