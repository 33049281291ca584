// The program abs_hil with the controllers and boards of this project alone.
#include <sys/prctl.h>

#include "abs_hil/program/program.hpp"

int main(int argc, char** argv) {
  ::prctl(PR_SET_NAME, "abs_hil");  // as people start it (command.cpp), and as messages about processes name it
  return abs_hil::program::run_program(argc, argv);
}
