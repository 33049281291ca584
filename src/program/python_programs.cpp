#include "program/python_programs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "program/exit_status.hpp"

namespace abs_hil::program {

std::optional<int> start_python_program(int argc, char** argv) {
  if (argc < 2) return std::nullopt;
  const auto named = std::find_if(python_programs.begin(), python_programs.end(),
                                  [&](const PythonProgram& program) { return program.name == argv[1]; });
  if (named == python_programs.end()) return std::nullopt;

  const std::string file = fmt::format("abs_{}", named->name);
  std::error_code error;
  const std::string beside = (std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / file).string();
  std::vector<char*> arguments{const_cast<char*>(file.c_str())};  // exec changes none of them
  arguments.insert(arguments.end(), argv + 2, argv + argc);
  arguments.push_back(nullptr);
  ::execv(beside.c_str(), arguments.data());
  if (errno == ENOENT) ::execvp(file.c_str(), arguments.data());
  const int why = errno;
  fmt::print(
      stderr,
      "abs_hil: {}: {}: `abs_hil {}` is a program in Python; install the package python3-abs-hil, or `pip install "
      ".` in the source folder\n",
      beside, std::strerror(why), named->name);
  return exit_unavailable;
}

}  // namespace abs_hil::program
