#include "watch/cell_grid.hpp"

#include <algorithm>

namespace abs_hil::watch {
namespace {

constexpr char32_t replacement = U'?';

/// Removes and returns the first character of `text`, which must not be empty.
char32_t take_character(std::string_view& text) {
  const auto byte = [&text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  std::size_t length = 1;
  char32_t value = first;
  if (first >= 0xF0 && first < 0xF5) {
    length = 4;
    value = first & 0x07U;
  } else if (first >= 0xE0 && first < 0xF0) {
    length = 3;
    value = first & 0x0FU;
  } else if (first >= 0xC2 && first < 0xE0) {
    length = 2;
    value = first & 0x1FU;
  } else if (first >= 0x80) {
    value = replacement;
  }
  for (std::size_t i = 1; i < length; ++i) {
    if (i >= text.size() || (byte(i) & 0xC0U) != 0x80U) {
      text.remove_prefix(1);
      return replacement;
    }
    value = value << 6U | (byte(i) & 0x3FU);
  }
  text.remove_prefix(length);
  const bool control = value < 0x20 || (value >= 0x7F && value < 0xA0);
  const bool surrogate = value >= 0xD800 && value < 0xE000;
  return control || surrogate || value > 0x10FFFF ? replacement : value;
}

bool combining(char32_t glyph) { return glyph >= 0x300 && glyph < 0x370; }

void append_utf8(std::string& text, char32_t glyph) {
  const auto put = [&text](char32_t bits) { text += static_cast<char>(bits); };
  if (glyph < 0x80) {
    put(glyph);
  } else if (glyph < 0x800) {
    put(0xC0U | glyph >> 6U);
    put(0x80U | (glyph & 0x3FU));
  } else if (glyph < 0x10000) {
    put(0xE0U | glyph >> 12U);
    put(0x80U | (glyph >> 6U & 0x3FU));
    put(0x80U | (glyph & 0x3FU));
  } else {
    put(0xF0U | glyph >> 18U);
    put(0x80U | (glyph >> 12U & 0x3FU));
    put(0x80U | (glyph >> 6U & 0x3FU));
    put(0x80U | (glyph & 0x3FU));
  }
}

}  // namespace

CellGrid::CellGrid(int columns, int rows)
    : columns_(std::max(columns, 0)),
      rows_(std::max(rows, 0)),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}

Cell CellGrid::at(int column, int row) const noexcept {
  return inside(column, row) ? cells_[index(column, row)] : Cell{};
}

void CellGrid::put(int column, int row, Cell cell) noexcept {
  if (inside(column, row)) cells_[index(column, row)] = cell;
}

int CellGrid::write(int column, int row, std::string_view text, Style style) {
  while (!text.empty()) {
    const char32_t glyph = take_character(text);
    if (combining(glyph)) {
      if (inside(column - 1, row)) cells_[index(column - 1, row)].mark = glyph;
      continue;
    }
    put(column, row, {glyph, 0, style});
    ++column;
  }
  return column;
}

std::string CellGrid::to_text() const {
  std::string text;
  for (int row = 0; row < rows_; ++row) {
    std::size_t end = text.size();
    for (int column = 0; column < columns_; ++column) {
      const Cell& cell = cells_[index(column, row)];
      append_utf8(text, cell.glyph);
      if (cell.mark != 0) append_utf8(text, cell.mark);
      if (cell.glyph != U' ') end = text.size();
    }
    text.resize(end);
    text += '\n';
  }
  return text;
}

int columns_of(std::string_view text) {
  int columns = 0;
  while (!text.empty()) columns += combining(take_character(text)) ? 0 : 1;
  return columns;
}

}  // namespace abs_hil::watch
