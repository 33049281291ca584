#include "watch/cell_grid.hpp"

#include <string>

#include "catch.hpp"

using abs_hil::watch::Cell;
using abs_hil::watch::CellGrid;
using abs_hil::watch::columns_of;
using abs_hil::watch::Style;

TEST_CASE("text with characters of one to four bytes is unchanged") {
  CellGrid grid(12, 2);
  CHECK(grid.write(1, 0, "aω⠿𝄞b", Style::bold) == 6);
  CHECK(grid.at(1, 0).glyph == U'a');
  CHECK(grid.at(2, 0).glyph == U'ω');
  CHECK(grid.at(3, 0).glyph == U'⠿');
  CHECK(grid.at(4, 0).glyph == U'𝄞');
  CHECK(grid.at(5, 0).style == Style::bold);
  CHECK(grid.to_text() == " aω⠿𝄞b\n\n");
}

TEST_CASE("a combining mark stands over its letter and takes no column") {
  CellGrid grid(4, 1);
  CHECK(grid.write(0, 0, "θ̂x") == 2);
  CHECK(grid.at(0, 0).glyph == U'θ');
  CHECK(grid.at(0, 0).mark == 0x302);
  CHECK(grid.to_text() == "θ̂x\n");
  CHECK(columns_of("θ̂x") == 2);
  CHECK(grid.write(0, 0, "\xCC\x82") == 0);  // there is no character below it
}

TEST_CASE("places outside ignore writes and read as blanks") {
  CellGrid grid(3, 1);
  CHECK(grid.write(1, 0, "abcd") == 5);
  CHECK(grid.write(-1, 0, "xy") == 1);
  grid.write(0, 7, "nowhere");
  grid.put(-1, -1, Cell{U'x'});
  CHECK(grid.to_text() == "yab\n");
  CHECK(grid.at(3, 0).glyph == U' ');
  CHECK(CellGrid(-5, 3).to_text() == "\n\n\n");
}

TEST_CASE("invalid UTF-8 and control characters become question marks") {
  const auto shown = [](std::string_view text) {
    CellGrid grid(10, 1);
    grid.write(0, 0, text);
    return grid.to_text();
  };
  CHECK(shown("a\x1b[2Jb") == "a?[2Jb\n");
  CHECK(shown("\xff\xfe") == "??\n");
  CHECK(shown("\xe2\x82") == "??\n");           // cut short
  CHECK(shown("\xed\xa0\x80x") == "?x\n");      // a surrogate
  CHECK(shown("\xf4\x90\x80\x80x") == "?x\n");  // above U+10FFFF
  CHECK(shown("\xc2\x9bx") == "?x\n");          // CSI in one character
}
