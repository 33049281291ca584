// Who answers the questions of a run's phases, before it starts.
#include "program/answers.hpp"

#ifdef _WIN32
#include <io.h>
#else
#include <unistd.h>
#endif

#include <algorithm>
#include <cstdio>

#include "config/config_error.hpp"

namespace abs_hil::program {

bool hears_commands(const RunRequest& request) {
  return request.settings.commands.enabled && !request.outputs.no_lcm && !request.outputs.fast;
}

bool at_terminal() noexcept {
#ifdef _WIN32
  return ::_isatty(::_fileno(stdin)) != 0;
#else
  return ::isatty(STDIN_FILENO) == 1;
#endif
}

bool asks(const config::Script& script) noexcept {
  return std::any_of(script.phases.begin(), script.phases.end(),
                     [](const config::PhaseScript& phase) { return !phase.ask.empty(); });
}

const char* who_answers(const RunRequest& request) {
  if (request.settings.on_rig()) return answers_person;
  return request.outputs.fast || !at_terminal() ? answers_itself : answers_person;
}

void check_questions(const RunRequest& request) {
  const config::Settings& s = request.settings;
  if (!asks(*request.script)) return;
  const std::string name = "experiment " + request.script->name;
  if (s.experiment.answers == answers_person) {
    if (request.outputs.fast) {
      throw config::ConfigError(name +
                                " asks a person: a run in virtual time (--fast) cannot wait; leave out --fast, or "
                                "experiment.answers = person");
    }
    if (!at_terminal() && !hears_commands(request)) {
      throw config::ConfigError(
          name +
          " asks a person, but stdin is no terminal and remote commands are not enabled: start it in a terminal, "
          "or with --set commands.enabled=true --set commands.key_file=FILE and without --no-lcm, and answer with "
          "abs_hil send continue");
    }
  } else if (s.on_rig() && !s.driver.emulated) {
    throw config::ConfigError(name +
                              ": experiment.answers = itself: on a rig only a person can say that it is done; "
                              "leave it out");
  }
}

}  // namespace abs_hil::program
