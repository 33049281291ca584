#include "report/gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "report/input_error.hpp"
#include "report/run_details.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace fs = std::filesystem;

namespace {

constexpr const char* script_name = "figures.gp";
constexpr const char* words_name = "gnuplot.log";
constexpr int not_found_status = 127;  ///< exit status that POSIX permits instead of an error of posix_spawnp

/// Returns the program's exit status, -1 after a signal. Throws UnavailableError if the program is missing.
int run_gnuplot(const fs::path& folder) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, words_name, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  // --default-settings keeps a user's .gnuplot from changing the figures.
  std::array<std::string, 3> words{"gnuplot", "--default-settings", script_name};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  int status = not_found_status;
  if (error == 0) {
    int wait_status = 0;
    while (::waitpid(child, &wait_status, 0) < 0 && errno == EINTR) {
    }
    status = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : -1;
  }
  if (status == not_found_status) {
    throw UnavailableError("gnuplot, which draws the figures, is missing; install it: apt-get install gnuplot-nox");
  }
  return status;
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = (fs::temp_directory_path() / "abs_report_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error(fmt::format("cannot create a temporary folder \"{}\": {}", name, std::strerror(errno)));
  }
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void draw(const std::vector<Figure>& figures, PictureFormat format, const fs::path& folder) {
  {
    std::ofstream script(folder / script_name, std::ios::binary);
    script << gnuplot_script(figures, format);
    script.close();
    if (!script) throw std::runtime_error(fmt::format("cannot write to \"{}\"", folder.string()));
  }
  const int status = run_gnuplot(folder);
  for (const Figure& figure : figures) {
    std::error_code error;
    const auto size = fs::file_size(folder / fmt::format("{}.{}", figure.id, extension_of(format)), error);
    if (status == 0 && !error && size > 0) continue;
    throw std::runtime_error(fmt::format("gnuplot did not draw {} (status {}): {}", figure.id, status,
                                         clean_text(read_text(folder / words_name), 500)));
  }
}

}  // namespace abs_hil::report
