#include "signals.hpp"

#include <atomic>
#include <csignal>

namespace abs_hil::app {

namespace {
std::atomic<rig::Reason> noted{rig::Reason::none};
static_assert(std::atomic<rig::Reason>::is_always_lock_free, "a signal handler may touch nothing else");

void note(int signal) { noted.store(signal == SIGINT ? rig::Reason::interrupt_signal : rig::Reason::terminate_signal); }
}  // namespace

void note_signals() {
  struct sigaction action {};
  action.sa_handler = note;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  action.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &action, nullptr);
}

rig::Reason signalled() noexcept { return noted.load(); }

}  // namespace abs_hil::app
