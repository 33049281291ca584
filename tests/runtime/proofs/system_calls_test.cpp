// The cycle makes no system call but its sleep: the kernel itself (seccomp) traps any other.

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <fstream>

#include "catch.hpp"
#include "cycle_run.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

/// Result of the trapped process, in memory that it shares with the test.
struct Trapped {
  int system_calls{0};
  int first_number{-1};
  std::uint64_t cycles{0};
  bool completed{false};
};
Trapped* trapped = nullptr;

void on_trap(int, siginfo_t* info, void*) {
  if (trapped->system_calls++ == 0) trapped->first_number = info->si_syscall;
}

/// Reads the clock and sleeps as in a real run, but gives the executive a time that advances only by sleeping. The
/// number of cycles therefore does not depend on the machine's load.
class SleepingVirtualClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override {
    static_cast<void>(real_.now_ns());
    return virtual_.now_ns();
  }
  void sleep_until(std::int64_t time_ns) noexcept override {
    constexpr std::int64_t nap_ns = 20'000;
    real_.sleep_until(real_.now_ns() + nap_ns);
    virtual_.sleep_until(time_ns);
  }

 private:
  MonotonicClock real_;
  VirtualClock virtual_;
};

/// With these clocks clock_gettime is answered without entering the kernel.
bool clock_read_in_user_space() {
  std::ifstream file("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  std::string source;
  file >> source;
  return source == "tsc" || source == "kvm-clock" || source == "arch_sys_counter";
}

constexpr sock_filter allow(int system_call) {
  return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(system_call), 0, 1);
}
constexpr sock_filter give(std::uint32_t verdict) { return BPF_STMT(BPF_RET | BPF_K, verdict); }

/// From now on this process may sleep and end; all else is trapped and not done.
bool trap_system_calls() {
  const int clock_call = clock_read_in_user_space() ? __NR_clock_nanosleep : __NR_clock_gettime;
  std::array<sock_filter, 10> program{
      sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offsetof(seccomp_data, nr))),
      allow(__NR_clock_nanosleep),
      give(SECCOMP_RET_ALLOW),
      allow(__NR_exit_group),
      give(SECCOMP_RET_ALLOW),
      allow(__NR_rt_sigreturn),
      give(SECCOMP_RET_ALLOW),
      allow(clock_call),
      give(SECCOMP_RET_ALLOW),
      give(SECCOMP_RET_TRAP)};
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter, 0, 0) == 0;
}

/// Runs an experiment from 25 rad/s to its end in a process of its own, at 5 kHz.
Trapped run_trapped(const std::string& controller, PlantedLogic::Offence offence = nullptr) {
  void* const shared = mmap(nullptr, sizeof(Trapped), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  REQUIRE(shared != MAP_FAILED);
  trapped = new (shared) Trapped;
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    SleepingVirtualClock clock;
    CycleRun run(clock, controller, 5000.0, 25.0, offence);
    struct sigaction action {};
    action.sa_sigaction = on_trap;
    action.sa_flags = SA_SIGINFO;
    if (sigaction(SIGSYS, &action, nullptr) != 0 || !trap_system_calls()) _exit(1);
    while (run.cycle()) {
    }
    trapped->cycles = run.cycles();
    trapped->completed = run.end_reason() == rig::Reason::sequence_complete;
    _exit(0);
  }
  int status = -1;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(status == 0);
  const Trapped result = *trapped;
  munmap(shared, sizeof(Trapped));
  return result;
}

}  // namespace

TEST_CASE("a whole experiment makes no system call but the sleep, with every controller") {
  for (const std::string& controller : all_controllers()) {
    const Trapped result = run_trapped(controller);
    CAPTURE(controller, result.first_number, result.cycles);
    CHECK(result.system_calls == 0);
    CHECK(result.completed);
    CHECK(result.cycles > 1'000);
  }
}

TEST_CASE("a planted system call is found and named") {
  const Trapped result = run_trapped("adaptive", [] { static_cast<void>(getppid()); });
  CHECK(result.system_calls == 1);
  CHECK(result.first_number == __NR_getppid);
  const Trapped printing = run_trapped("adaptive", [] { static_cast<void>(write(2, "", 0)); });
  CHECK(printing.system_calls == 1);
  CHECK(printing.first_number == __NR_write);
}
