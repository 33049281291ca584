#pragma once

#include <string>
#include <vector>

namespace abs_hil::report {

/// A table of a page. Cells are plain text: made safe when they are written down.
struct Table {
  std::string id{};
  std::vector<std::string> header{};
  std::vector<std::vector<std::string>> rows{};
  /// The first column names what stands in the row; all others are numbers, aligned to the right.
  bool numbers{true};

  [[nodiscard]] std::string html() const;
  /// Rows become columns, for many runs.
  [[nodiscard]] Table turned() const;
};

}  // namespace abs_hil::report
