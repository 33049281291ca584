#include "abs_hil/app/program.hpp"

int main(int argc, char** argv) { return abs_hil::app::run_program(argc, argv); }
