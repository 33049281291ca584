// Puts an experiment's questions to the terminal, and refuses those that nobody could answer.
#include "program/questions.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "config/config_error.hpp"

namespace abs_hil::program {

bool hears_commands(const RunRequest& request) {
  return request.settings.commands.enabled && !request.outputs.no_lcm && !request.virtual_time;
}

bool at_terminal() noexcept { return ::isatty(STDIN_FILENO) == 1; }

void check_questions(const RunRequest& request) {
  const config::Settings& s = request.settings;
  if (!config::asks(*request.script)) return;
  if (s.experiment.answers == experiment::answers_person && !at_terminal() && !hears_commands(request)) {
    throw config::ConfigError(
        fmt::format("experiment {} asks a person, but stdin is no terminal and remote commands are not enabled: start "
                    "it in a terminal, or with --set commands.enabled=true --set commands.key_file=FILE and without "
                    "--no-lcm, and answer with abs_hil send continue",
                    request.script->name));
  }
  if (s.experiment.answers == experiment::answers_itself && s.on_rig() && !s.driver.emulated) {
    throw config::ConfigError(fmt::format(
        "experiment {}: experiment.answers = itself: on a rig only a person can say that it is done; leave it out",
        request.script->name));
  }
}

Questions::Questions(const RunRequest& request, run::Run& run)
    : run_(run),
      by_person_(request.settings.experiment.answers == experiment::answers_person),
      commands_(hears_commands(request)),
      terminal_(at_terminal()) {
  if (by_person_ || !config::asks(*request.script) || request.in_series) return;
  spdlog::info("the simulation answers the questions of experiment {} itself, at once", request.script->name);
}

void Questions::poll() {
  if (!by_person_) return;
  const rig::CycleRecord& latest = run_.latest();
  const std::string_view question = run_.names().question_of(latest);
  if (question.empty()) {
    asked_ = -1;
    return;
  }
  if (asked_ != latest.phase_index) {
    asked_ = latest.phase_index;
    // An Enter from before answers nothing.
    if (terminal_) static_cast<void>(::tcflush(STDIN_FILENO, TCIFLUSH));
    fmt::print(stderr, "\n{}{}\n", question, commands_ ? " (or: abs_hil send continue)" : "");
    std::fflush(stderr);
    return;
  }
  if (terminal_ && entered()) static_cast<void>(run_.adjustments().put({.kind = experiment::Adjustment::Kind::answer}));
}

bool Questions::entered() {
  pollfd ready{STDIN_FILENO, POLLIN, 0};
  if (::poll(&ready, 1, 0) <= 0 || (ready.revents & POLLIN) == 0) return false;
  std::array<char, 256> line{};
  const ssize_t size = ::read(STDIN_FILENO, line.data(), line.size());
  if (size <= 0) {  // the terminal was closed
    terminal_ = false;
    return false;
  }
  return std::find(line.begin(), line.begin() + size, '\n') != line.begin() + size;
}

}  // namespace abs_hil::program
