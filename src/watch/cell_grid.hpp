#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::watch {

/// Style of a cell. A terminal without colours distinguishes only `bold` and `alarm` from the rest.
enum class Style : std::uint8_t { normal, dim, bold, alarm, good, first_line, second_line };

/// One character cell of a terminal.
struct Cell {
  char32_t glyph{U' '};
  char32_t mark{0};  ///< combining mark over the glyph, 0 = none
  Style style{Style::normal};
};

/// A grid of character cells, independent of any terminal. It ignores writes outside its area.
class CellGrid {
 public:
  /// Negative sizes count as 0.
  CellGrid(int columns, int rows);

  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  /// The cell, or a blank for a place outside.
  [[nodiscard]] Cell at(int column, int row) const noexcept;

  void put(int column, int row, Cell cell) noexcept;
  /// Writes UTF-8 and returns the column after the whole text, even if the text was cut off. Combining marks take no
  /// column. Invalid UTF-8 and control characters become '?'.
  int write(int column, int row, std::string_view text, Style style = Style::normal);

  /// The characters as UTF-8, one line per row, without trailing blanks.
  [[nodiscard]] std::string to_text() const;

 private:
  [[nodiscard]] bool inside(int column, int row) const noexcept {
    return column >= 0 && column < columns_ && row >= 0 && row < rows_;
  }
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }

  int columns_;
  int rows_;
  std::vector<Cell> cells_;
};

/// Number of columns that UTF-8 text takes in a CellGrid.
[[nodiscard]] int columns_of(std::string_view text);

}  // namespace abs_hil::watch
