#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace abs_hil::program {

/// A program in Python that `abs_hil NAME ...` starts: abs_NAME, beside abs_hil or in the PATH.
struct PythonProgram {
  std::string_view name;
  std::string_view help;
};

inline constexpr std::array python_programs{
    PythonProgram{"report", "make a page with figures and tables of recorded runs, or export their rows"},
    PythonProgram{"tune", "search for a controller's gains in simulation"},
    PythonProgram{"identify", "estimate the rig's parameters from its own logs, with intervals"},
    PythonProgram{"benchmark", "score controllers against the shortest braking, over a fixed set of cases"},
    PythonProgram{"learn", "train a small controller in simulation, from nothing but trial and error"},
};

/// If the first argument names such a program, it takes this process over with the other arguments. Returns the exit
/// status if that fails, after a message that says what to install; nothing for any other first argument.
[[nodiscard]] std::optional<int> start_python_program(int argc, char** argv);

}  // namespace abs_hil::program
