// Catches exit() and system calls by which a controller's code would end the program in mid-run.
#include "runtime/early_end.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

namespace abs_hil::runtime {

namespace {

/// Second argument of exit_group, which the kernel does not look at: tells our own end from one of foreign code.
constexpr std::uint32_t own_end = 0x0AB5'0E1D;

std::atomic<bool> watched{false};
/// A child process that foreign code made must not touch the board beside its parent.
std::atomic<pid_t> own_process{0};
std::atomic<Outputs*> running{nullptr};
thread_local Outputs* of_this_thread = nullptr;

void say(std::string_view text) noexcept {
  pollfd room{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&room, 1, 0) == 1) static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
}

[[noreturn]] void end_program(int status) noexcept {
  while (true) ::syscall(SYS_exit_group, status, own_end);
}

/// Another thread ends the program already.
std::atomic_flag ending;
[[noreturn]] void wait_for_the_end() noexcept {
  while (true) ::poll(nullptr, 0, 1000);
}

}  // namespace

void end_early(std::string_view why, bool make_safe) noexcept {
  const pid_t own = own_process.load();  // 0: nobody watches
  if (own != 0 && own != ::getpid()) end_program(1);
  if (ending.test_and_set()) wait_for_the_end();
  std::string_view outputs;
  Outputs* others = running.load();
  if (make_safe && (of_this_thread != nullptr || others != nullptr)) {
    const bool safe = of_this_thread != nullptr ? of_this_thread->make_safe_now() : others->have_made_safe();
    outputs = safe ? " The outputs are safe."
                   : " The safe state may not have reached the board: press the E-stop and switch the rig off.";
  }
  std::array<char, 512> text{};
  const auto end =
      fmt::format_to_n(text.data(), text.size(), "abs_hil: {}; the program ends with status 1.{}\n", why, outputs);
  say({text.data(), std::min(end.size, text.size())});
  end_program(1);
}

namespace {

void on_exit() noexcept {
  if (watched.load()) {
    end_early("fault: code in this program, such as the controller's, called exit() or quick_exit()", true);
  }
}

/// For quick_exit(), and for a call that does not meet our exit() below, such as one within the C library.
void catch_exit() noexcept {
  own_process = ::getpid();
  // The latest function is called first. So each run registers it anew, before the destructors of what was made since.
  static_cast<void>(std::atexit(on_exit));
  static_cast<void>(std::at_quick_exit(on_exit));
}

[[noreturn]] void exit_of_the_library(int status) noexcept {
  const auto function = reinterpret_cast<void (*)(int)>(::dlsym(RTLD_NEXT, "exit"));
  if (function != nullptr) function(status);
  end_program(status);
}

/// exit_group or exec of the cycle's thread.
void on_system_call(int /*signal*/, siginfo_t* info, void* /*context*/) {
  if (!watched.load()) end_program(1);
  end_early(info->si_syscall == SYS_exit_group
                ? "fault: code in the cycle, such as the controller's, called _exit()"
                : "fault: code in the cycle, such as the controller's, put another program in this one's place",
            true);
}

void catch_system_call() noexcept {
  struct sigaction action {};
  action.sa_sigaction = on_system_call;
  action.sa_flags = SA_SIGINFO;
  if (::sigaction(SIGSYS, &action, nullptr) != 0) return;
  sigset_t trap{};
  sigemptyset(&trap);
  sigaddset(&trap, SIGSYS);
  ::pthread_sigmask(SIG_UNBLOCK, &trap, nullptr);
  std::array filter{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_execve, 4, 0),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_execveat, 3, 0),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit_group, 0, 3),
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args) + sizeof(std::uint64_t)),
      sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, own_end, 1, 0),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
      sock_filter BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog program{.len = static_cast<unsigned short>(filter.size()), .filter = filter.data()};
  // Of this thread alone. Speculation stays as it is: the filter is no fence.
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return;
  static_cast<void>(::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_SPEC_ALLOW, &program));
}

}  // namespace

}  // namespace abs_hil::runtime

// Stands before the C library's exit(), which calls destructors of objects that other threads still use (the runs of a
// comparison) before it calls a function that was registered earlier.
extern "C" [[gnu::noreturn]] void exit(int status) noexcept {
  abs_hil::runtime::on_exit();
  abs_hil::runtime::exit_of_the_library(status);
}

namespace abs_hil::runtime {

EarlyEndWatch::EarlyEndWatch() {
  catch_exit();
  watched = true;
}

EarlyEndWatch::~EarlyEndWatch() {
  watched = false;
  // A thread that called exit() ended the run. The status is that thread's, however late it gets a processor.
  if (ending.test()) wait_for_the_end();
}

CycleInThisThread::CycleInThisThread(Outputs& outputs, bool own_thread) noexcept : before_(of_this_thread) {
  of_this_thread = &outputs;
  running = &outputs;
  if (!watched) return;
  catch_exit();
  if (own_thread) catch_system_call();
}

CycleInThisThread::~CycleInThisThread() {
  running = nullptr;
  of_this_thread = before_;
}

}  // namespace abs_hil::runtime
