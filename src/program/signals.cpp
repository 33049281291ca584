// Notes SIGINT, SIGTERM and SIGHUP. A run asks for them between its cycles, or is told by the handler.
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

constexpr int exit_of_signal = 128;

std::atomic<rig::Reason> noted{rig::Reason::none};
std::atomic<run::Run*> running{nullptr};
std::atomic<bool> may_leave_now{false};
static_assert(std::atomic<rig::Reason>::is_always_lock_free && std::atomic<run::Run*>::is_always_lock_free,
              "a signal handler may touch nothing else");

rig::Reason reason_of(int signal) noexcept {
  if (signal == SIGINT) return rig::Reason::interrupt_signal;
  return signal == SIGHUP ? rig::Reason::hangup_signal : rig::Reason::terminate_signal;
}

void note(int signal) {
  rig::Reason none = rig::Reason::none;
  const bool first = noted.compare_exchange_strong(none, reason_of(signal));
  if (!first && may_leave_now.load()) ::_exit(exit_of_signal + signal);
  if (run::Run* run = running.load(); run != nullptr) run->request_stop(reason_of(signal));
}

bool ignored(int signal) noexcept {
  struct sigaction current {};
  return ::sigaction(signal, nullptr, &current) == 0 && current.sa_handler == SIG_IGN;
}

}  // namespace

void survive_closed_terminals() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    // open() returns the lowest free descriptor. Results that nobody takes are told as lost (cli::with_stdout).
    const int mode = fd == STDOUT_FILENO ? O_RDONLY : O_RDWR;
    if (::fcntl(fd, F_GETFD) < 0) static_cast<void>(::open("/dev/null", mode));
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file at its size limit is reported by the failed write, like a full disk
}

void note_signals(bool may_leave) {
  may_leave_now = may_leave;
  struct sigaction action {};
  action.sa_handler = note;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    if (signal == SIGHUP && ignored(signal)) continue;
    ::sigaction(signal, &action, nullptr);
  }
}

int status_of(rig::Reason signal) noexcept {
  switch (signal) {
    case rig::Reason::interrupt_signal: return exit_interrupted;
    case rig::Reason::hangup_signal: return exit_hung_up;
    default: return exit_terminated;
  }
}

rig::Reason signalled() noexcept { return noted.load(); }

SignalsStop::SignalsStop(run::Run& run, bool may_leave) noexcept {
  may_leave_now = may_leave;
  running = &run;
}

SignalsStop::~SignalsStop() {
  running = nullptr;
  may_leave_now = true;
}

void SignalsStop::allow_leaving() noexcept { may_leave_now = true; }

}  // namespace abs_hil::program
