// The guardian that goes with it. Its program must be called abs_guardian and lie beside the other one.
#include <abs_hil/program/program.hpp>

#include "serial_board.hpp"

int main(int argc, char** argv) {
  const abs_hil::driver::Backend boards[]{serial_board::serial_backend()};
  return abs_hil::program::run_guardian(argc, argv, boards);
}
