// The table of subcommands, and the programs in Python among them.
#include "program/subcommands.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "program/extra.hpp"
#include "rig/error_words.hpp"

namespace abs_hil::program {

namespace {

constexpr std::array table{
    Subcommand{"list", "list controllers, plants, experiments and backends", &add_list},
    Subcommand{"doctor", "check this computer and give a fix for each shortcoming", &add_doctor},
    Subcommand{"latency", "run the real-time cycle on the simulated rig and judge this computer's timing",
               &add_latency},
    Subcommand{"validate", "describe an experiment and check it against the limits", &add_validate},
    Subcommand{"commission", "first steps with a real rig; asks before each step", &add_commission},
    Subcommand{"init-rig", "write NAME.toml, the parameters of a rig of your own to fill in", &add_init_rig},
    Subcommand{"safe",
               "make the configured board, or every board found, safe and verify it; ends the run that drives it",
               &add_safe},
    Subcommand{"log", "say what recordings hold: log info FILE"},
    Subcommand{"convert", "convert a recorded run to .csv, .mcap or .parquet, or record a running one"},
    Subcommand{"export-fmu",
               "write the simulated rig, or with --controller a slip controller, as an FMU for other tools"},
    Subcommand{"watch", "show a running experiment in this terminal, over LCM; q quits"},
    Subcommand{"serve", "show a running experiment, or a recorded one, as a scope in the browser"},
    Subcommand{"lab", "make a page that simulates the rig and its controllers in the browser, without a server"},
    Subcommand{"report", "make a page with figures and tables of recorded runs, or export their rows"},
    Subcommand{"tune", "search for a controller's gains in simulation"},
    Subcommand{"identify", "estimate the rig's parameters from its own logs, with intervals"},
    Subcommand{"benchmark", "score controllers against the shortest braking, over a fixed set of cases"},
    Subcommand{"rig", "write a simulated rig that a class does not know, steady or wandering"},
    Subcommand{"learn", "train a small controller in simulation, from nothing but trial and error"},
};

}  // namespace

const std::vector<Subcommand>& subcommands() {
  static const std::vector<Subcommand> all = [] {
    std::vector<Subcommand> rows(table.begin(), table.end());
    for (const Extra* extra : extras()) rows.insert(rows.end(), extra->subcommands.begin(), extra->subcommands.end());
    return rows;
  }();
  return all;
}

std::optional<int> start_python_program(int argc, char** argv) {
  if (argc < 2) return std::nullopt;
  const std::string_view name = argv[1];
  const bool listed =
      std::ranges::any_of(table, [&](const Subcommand& row) { return row.add == nullptr && row.name == name; });
  if (!listed) return std::nullopt;

  const std::string file = fmt::format("abs_{}", name);
  std::vector<char*> arguments{const_cast<char*>(file.c_str())};  // exec changes none of them
  arguments.insert(arguments.end(), argv + 2, argv + argc);
  arguments.push_back(nullptr);
  ::execvp(python_program(name).c_str(), arguments.data());
  cli::print(stderr, "abs_hil: {}\n", no_python_program(name, errno));
  return exit_unavailable;
}

std::string python_program(std::string_view name) {
  std::error_code error;
  const std::filesystem::path beside = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  std::string file = fmt::format("abs_{}", name);
  const std::filesystem::path path = beside / file;
  return std::filesystem::exists(path, error) ? path.string() : file;
}

std::string no_python_program(std::string_view name, int error) {
  const std::string cause = error == ENOENT ? "No such file or directory; install the package python3-abs-hil, or `pip "
                                              "install .` in the source folder"
                                            : rig::refusal(error, python_program(name), rig::starting);
  return fmt::format("{}: {} (it is a program in Python)", python_program(name), cause);
}

}  // namespace abs_hil::program
