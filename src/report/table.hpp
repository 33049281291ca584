#pragma once

#include <string>
#include <vector>

namespace abs_hil::report {

/// A table of a page. Cells are plain text; html() escapes them.
struct Table {
  std::string id{};
  std::vector<std::string> header{};
  std::vector<std::vector<std::string>> rows{};
  /// The first column names the row; all others are numbers, aligned to the right.
  bool numbers{true};

  [[nodiscard]] std::string html() const;
  /// Exchanges rows and columns, for many runs.
  [[nodiscard]] Table turned() const;
};

}  // namespace abs_hil::report
