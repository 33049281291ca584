#include "program/python_programs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "program/exit_status.hpp"

namespace abs_hil::program {

namespace {

/// `abs_hil convert` itself knows event logs and CSV. Other formats need libraries that only the Python package has.
bool converts_in_python(std::span<char* const> arguments) {
  return std::any_of(arguments.begin(), arguments.end(), [](std::string_view argument) {
    return argument.ends_with(".mcap") || argument.ends_with(".parquet") || argument.starts_with("--live");
  });
}

}  // namespace

std::optional<int> start_python_program(int argc, char** argv) {
  if (argc < 2) return std::nullopt;
  const std::string_view name = argv[1];
  const bool listed = std::any_of(python_programs.begin(), python_programs.end(),
                                  [&](const PythonProgram& program) { return program.name == name; });
  if (!listed && !(name == "convert" && converts_in_python({argv + 2, argv + argc}))) return std::nullopt;

  const std::string file = fmt::format("abs_{}", name);
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
      beside, std::strerror(why), name);
  return exit_unavailable;
}

}  // namespace abs_hil::program
