// The program abs_guardian.
#include "abs_hil/program/program.hpp"

int main(int argc, char** argv) { return abs_hil::program::run_guardian(argc, argv); }
