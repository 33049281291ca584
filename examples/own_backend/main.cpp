// abs_hil with a board of its own. Build it beside the guardian below, which must know the board too.
#include <abs_hil/program/program.hpp>

#include "serial_board.hpp"

int main(int argc, char** argv) {
  const abs_hil::driver::Backend boards[]{serial_board::serial_backend()};
  return abs_hil::program::run_program(argc, argv, {}, boards);
}
