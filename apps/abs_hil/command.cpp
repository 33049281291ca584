// The command abs_hil: starts abs_hil_program, which stands beside it. That program loads thirty shared libraries
// before its main begins: 5 ms of processor time, and 150 ms among a dozen busy processes. The emergency stop has its
// priority before that. So this program must not need any library but libc.

#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>

#include "program/first_place.hpp"

int main(int argc, char** argv) {
  constexpr char ending[] = "_program";
  constexpr int unavailable = 3;
  if (argc > 1 && std::strcmp(argv[1], "safe") == 0) abs_hil::program::take_first_place();
  std::array<char, 4096> path{};
  const ssize_t length = ::readlink("/proc/self/exe", path.data(), path.size() - sizeof ending);
  if (length > 0) {
    std::memcpy(path.data() + length, ending, sizeof ending);
    ::execv(path.data(), argv);
  }
  std::fprintf(stderr, "abs_hil: %s: ", path.data());
  std::perror("the program itself cannot be started; install it whole");
  return unavailable;
}
