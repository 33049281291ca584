// Takes files, network, processes and memory away from foreign code: seccomp, Landlock, rlimits.
#include "interchange/confinement.hpp"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/capability.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <span>
#include <vector>

#include "interchange/host.hpp"

namespace abs_hil::interchange {

namespace {

struct SystemCall {
  std::uint32_t number;
  const char* name;
};
// NOLINTNEXTLINE(cppcoreguidelines-macro-usage)
#define ABS_HIL_CALL(name) \
  SystemCall { SYS_##name, #name }

/// They end the code: a controller that asks for them wants something that it cannot have, and has to be told.
constexpr std::array forbidden {
#if defined(__x86_64__)
  ABS_HIL_CALL(fork), ABS_HIL_CALL(vfork),
#endif
      ABS_HIL_CALL(execve), ABS_HIL_CALL(execveat), ABS_HIL_CALL(tkill), ABS_HIL_CALL(ptrace),
      ABS_HIL_CALL(process_vm_readv), ABS_HIL_CALL(process_vm_writev), ABS_HIL_CALL(pidfd_send_signal),
      ABS_HIL_CALL(sched_setscheduler), ABS_HIL_CALL(sched_setparam), ABS_HIL_CALL(sched_setattr),
      ABS_HIL_CALL(setpriority), ABS_HIL_CALL(ioprio_set), ABS_HIL_CALL(unshare), ABS_HIL_CALL(setns),
      ABS_HIL_CALL(mount), ABS_HIL_CALL(umount2), ABS_HIL_CALL(reboot)
};
/// They end the code for some of their arguments (below).
constexpr std::array forbidden_in_part{ABS_HIL_CALL(clone),
                                       ABS_HIL_CALL(kill),
                                       ABS_HIL_CALL(tgkill),
                                       ABS_HIL_CALL(rt_sigqueueinfo),
                                       ABS_HIL_CALL(rt_tgsigqueueinfo),
                                       ABS_HIL_CALL(prlimit64),
                                       ABS_HIL_CALL(prctl),
                                       ABS_HIL_CALL(fcntl),
                                       ABS_HIL_CALL(ioctl)};
/// They fail as they do on a system without them. Honest libraries try them and go on. They could reach around the
/// limits, outlive the process, or change files that cannot be written.
constexpr std::array absent {
#if defined(__x86_64__)
  ABS_HIL_CALL(chmod), ABS_HIL_CALL(chown), ABS_HIL_CALL(lchown),
#endif
      ABS_HIL_CALL(clone3), ABS_HIL_CALL(io_uring_setup), ABS_HIL_CALL(memfd_create), ABS_HIL_CALL(shmget),
      ABS_HIL_CALL(msgget), ABS_HIL_CALL(semget), ABS_HIL_CALL(mq_open), ABS_HIL_CALL(bpf),
      ABS_HIL_CALL(perf_event_open), ABS_HIL_CALL(pidfd_getfd), ABS_HIL_CALL(keyctl), ABS_HIL_CALL(add_key),
      ABS_HIL_CALL(userfaultfd), ABS_HIL_CALL(fchmod), ABS_HIL_CALL(fchmodat), ABS_HIL_CALL(fchown),
      ABS_HIL_CALL(fchownat), ABS_HIL_CALL(setxattr), ABS_HIL_CALL(lsetxattr), ABS_HIL_CALL(fsetxattr)
};

#undef ABS_HIL_CALL

#if defined(__x86_64__)
constexpr std::uint32_t this_architecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t this_architecture = AUDIT_ARCH_AARCH64;
#endif

TrappedSystemCalls trapped;
int answers_to = -1;
bool counting = false;

void on_trap(int /*signal*/, siginfo_t* info, void* context) {
  if (!counting) {
    const HostRefusal refusal{.system_call = info->si_syscall};
    static_cast<void>(::send(answers_to, &refusal, sizeof refusal, MSG_NOSIGNAL));
    ::_exit(1);
  }
  if (trapped.count++ == 0) trapped.first = info->si_syscall;
#if defined(__x86_64__)
  static_cast<ucontext_t*>(context)->uc_mcontext.gregs[REG_RAX] = -ENOSYS;
#elif defined(__aarch64__)
  static_cast<ucontext_t*>(context)->uc_mcontext.regs[0] = static_cast<std::uint64_t>(-ENOSYS);
#endif
}

bool catch_traps(int socket) {
  answers_to = socket;
  struct sigaction action {};
  action.sa_sigaction = on_trap;
  action.sa_flags = SA_SIGINFO | SA_NODEFER;
  return ::sigaction(SIGSYS, &action, nullptr) == 0;
}

constexpr std::uint32_t fails_with(std::uint32_t error) { return SECCOMP_RET_ERRNO | error; }

/// A filter of system calls, statement by statement. Each statement leaves the call's number loaded.
class Filter {
 public:
  Filter() { load(offsetof(seccomp_data, nr)); }

  void give(std::uint32_t verdict) { code_.push_back(BPF_STMT(BPF_RET | BPF_K, verdict)); }
  void give_for(std::uint32_t number, std::uint32_t verdict) {
    jump(BPF_JEQ, number, 0, 1);
    give(verdict);
  }
  /// For this call, if its argument `n` (lower half) equals a value, or does not.
  void give_if(std::uint32_t number, std::size_t n, std::uint32_t value, bool equal, std::uint32_t verdict) {
    about(number, n, BPF_JEQ, value, equal, verdict);
  }
  /// For this call, if these bits of its argument `n` are not set.
  void give_without(std::uint32_t number, std::size_t n, std::uint32_t bits, std::uint32_t verdict) {
    about(number, n, BPF_JSET, bits, false, verdict);
  }
  /// Kills what calls by the numbers of another architecture.
  void insist_on_architecture() {
    load(offsetof(seccomp_data, arch));
    jump(BPF_JEQ, this_architecture, 1, 0);
    give(SECCOMP_RET_KILL_PROCESS);
    load(offsetof(seccomp_data, nr));
#if defined(__x86_64__)
    constexpr std::uint32_t x32 = 0x4000'0000U;
    jump(BPF_JGE, x32, 0, 1);
    give(SECCOMP_RET_KILL_PROCESS);
#endif
  }
  [[nodiscard]] bool install() {
    const sock_fprog program{.len = static_cast<unsigned short>(code_.size()), .filter = code_.data()};
    return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
  }

 private:
  void load(std::size_t offset) {
    code_.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
  }
  void jump(unsigned kind, std::uint32_t value, std::uint8_t if_true, std::uint8_t if_false) {
    code_.push_back(BPF_JUMP(static_cast<std::uint16_t>(BPF_JMP | kind | BPF_K), value, if_true, if_false));
  }
  void about(std::uint32_t number, std::size_t n, unsigned kind, std::uint32_t value, bool holds,
             std::uint32_t verdict) {
    jump(BPF_JEQ, number, 0, 4);
    load(offsetof(seccomp_data, args) + n * sizeof(std::uint64_t));
    jump(kind, value, holds ? 0 : 1, holds ? 1 : 0);
    give(verdict);
    load(offsetof(seccomp_data, nr));
  }

  std::vector<sock_filter> code_{};
};

bool filter_calls() {
  const auto own = static_cast<std::uint32_t>(::getpid());
  constexpr std::uint32_t thread = 0x0001'0000;  // CLONE_THREAD
  constexpr std::uint32_t set_owner = 0x8901;    // FIOSETOWN
  constexpr std::uint32_t set_group = 0x8902;    // SIOCSPGRP
  constexpr std::uint32_t ends = SECCOMP_RET_TRAP;
  Filter filter;
  filter.insist_on_architecture();
  for (const SystemCall& call : forbidden) filter.give_for(call.number, ends);
  for (const SystemCall& call : absent) filter.give_for(call.number, fails_with(ENOSYS));
  filter.give_without(SYS_clone, 0, thread, ends);
  // Honest libraries ask whether there is a network (Python's), or local services for names of users (the C library's).
  filter.give_for(SYS_socket, fails_with(EACCES));
  for (const int call : {SYS_kill, SYS_tgkill, SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo}) {
    filter.give_if(static_cast<std::uint32_t>(call), 0, own, false, ends);
  }
  filter.give_if(SYS_prlimit64, 0, 0, false, ends);
  filter.give_if(SYS_sched_setaffinity, 0, 0, false, fails_with(EPERM));
  filter.give_if(SYS_prctl, 0, PR_SET_PDEATHSIG, true, ends);
  filter.give_if(SYS_rt_sigaction, 0, SIGSYS, true, fails_with(EPERM));
  // Signals to the owner of a descriptor would reach other processes.
  for (const int command : {F_SETOWN, F_SETSIG, F_SETOWN_EX}) {
    filter.give_if(SYS_fcntl, 1, static_cast<std::uint32_t>(command), true, ends);
  }
  for (const std::uint32_t command : {set_owner, set_group}) filter.give_if(SYS_ioctl, 1, command, true, ends);
  filter.give(SECCOMP_RET_ALLOW);
  return filter.install();
}

bool limit(int resource, std::uint64_t most) {
  rlimit limits{};
  if (::getrlimit(static_cast<__rlimit_resource_t>(resource), &limits) != 0) return false;
  limits.rlim_max = std::min<rlim_t>(limits.rlim_max, most);
  limits.rlim_cur = std::min<rlim_t>(limits.rlim_cur, most);
  return ::setrlimit(static_cast<__rlimit_resource_t>(resource), &limits) == 0;
}

bool limit_resources() {
#ifdef __has_feature
#define ABS_HIL_HAS_FEATURE(feature) __has_feature(feature)
#else
#define ABS_HIL_HAS_FEATURE(feature) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || ABS_HIL_HAS_FEATURE(address_sanitizer) || \
    ABS_HIL_HAS_FEATURE(thread_sanitizer)
  constexpr bool memory = true;  // sanitizers reserve terabytes of addresses
#else
  const bool memory = limit(RLIMIT_DATA, host_data_bytes_max) && limit(RLIMIT_AS, host_address_bytes_max);
#endif
  return memory && limit(RLIMIT_FSIZE, host_file_bytes_max) && limit(RLIMIT_NOFILE, host_descriptors_max) &&
         limit(RLIMIT_CORE, 0) && limit(RLIMIT_RTPRIO, 0);
}

/// Root keeps one right, to read what it could read: the library may lie in a user's folder.
bool drop_capabilities() {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, 2> sets{};
  if (::syscall(SYS_capget, &header, sets.data()) != 0) return false;
  for (auto& set : sets) set = {.effective = 0, .permitted = set.permitted, .inheritable = 0};
  sets[0].permitted &= 1U << CAP_DAC_READ_SEARCH;
  sets[0].effective = sets[0].permitted;
  sets[1].permitted = 0;
  return ::syscall(SYS_capset, &header, sets.data()) == 0;
}

/// Leaves files outside the folder for temporary files as they are. Without Landlock (before Linux 5.13, or switched
/// off) this does nothing. The headers of older distributions lack it, so its numbers stand here.
void keep_files() {
  constexpr long create_ruleset = 444;
  constexpr long add_rule = 445;
  constexpr long restrict_self = 446;
  constexpr unsigned ask_version = 1;
  constexpr int below_path = 1;
  const long version = ::syscall(create_ruleset, nullptr, 0, ask_version);
  if (version < 1) return;
  // Writing, removing and making files; from version 2 on moving them, from 3 on truncating them.
  std::uint64_t handled = 0x1FF2;
  if (version >= 2) handled |= 1U << 13U;
  if (version >= 3) handled |= 1U << 14U;
  const int rules = static_cast<int>(::syscall(create_ruleset, &handled, sizeof handled, 0));
  if (rules < 0) return;
  struct __attribute__((packed)) Below {
    std::uint64_t allowed;
    std::int32_t folder;
  };
  std::error_code error;
  const auto allow = [&](const std::filesystem::path& path, std::uint64_t allowed) {
    const Below below{.allowed = allowed, .folder = ::open(path.c_str(), O_PATH | O_CLOEXEC)};
    if (below.folder < 0) return;
    static_cast<void>(::syscall(add_rule, rules, below_path, &below, 0));
    ::close(below.folder);
  };
  allow(std::filesystem::temp_directory_path(error), handled);
  allow("/dev/null", 0x2);
  static_cast<void>(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0));
  static_cast<void>(::syscall(restrict_self, rules, 0));
  ::close(rules);
}

}  // namespace

std::string confine(int socket) {
  const auto failed = [](const char* what) { return std::string(what) + ": " + std::strerror(errno); };
  static_cast<void>(::syscall(SYS_close_range, socket + 1, ~0U, 0));
  if (!limit_resources()) return failed("setrlimit");
  keep_files();
  if (!drop_capabilities()) return failed("capset");
  if (!catch_traps(socket) || !filter_calls()) return failed("seccomp");
  return {};
}

const char* name_of_forbidden(std::int32_t number) noexcept {
  for (const std::span<const SystemCall> calls : {std::span<const SystemCall>(forbidden), {forbidden_in_part}}) {
    for (const SystemCall& call : calls) {
      if (call.number == static_cast<std::uint32_t>(number)) return call.name;
    }
  }
  return "another one";
}

bool trap_system_calls(int socket) {
  counting = true;
  if (answers_to < 0 && !catch_traps(socket)) return false;
  Filter filter;
  // The C library asks for memory by some of these; what the code allocates is counted elsewhere.
  for (const int call : {SYS_exit_group, SYS_rt_sigreturn, SYS_brk, SYS_mmap, SYS_munmap}) {
    filter.give_for(static_cast<std::uint32_t>(call), SECCOMP_RET_ALLOW);
  }
  filter.give_if(SYS_sendto, 0, static_cast<std::uint32_t>(socket), true, SECCOMP_RET_ALLOW);
  filter.give(SECCOMP_RET_TRAP);
  return filter.install();
}

TrappedSystemCalls trapped_system_calls() noexcept { return trapped; }

}  // namespace abs_hil::interchange
