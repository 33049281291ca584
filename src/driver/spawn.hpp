#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <initializer_list>
#include <string>
#include <utility>

namespace abs_hil::driver {

/// Starts a program in a session of its own, so that Ctrl-C ends this one alone, with default signals, empty input and
/// output, and these descriptors only: those here by those there. Returns 0, or an errno.
/// @param program  a path, or a name for the PATH
inline int spawn(pid_t& pid, const std::string& program, std::initializer_list<std::pair<int, int>> files) {
  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  int greatest = STDERR_FILENO;
  for (const auto& [from, to] : files) {
    posix_spawn_file_actions_adddup2(&actions, from, to);
    greatest = to > greatest ? to : greatest;
  }
  posix_spawn_file_actions_addclosefrom_np(&actions, greatest + 1);
  std::string name = program;
  std::array<char*, 2> arguments{name.data(), nullptr};
  const int error = ::posix_spawnp(&pid, program.c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  return error;
}

}  // namespace abs_hil::driver
