// Takes files, network, processes and memory away from foreign code: seccomp, Landlock, rlimits.
#include "interchange/confinement.hpp"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/capability.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/ioctl.h>
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
/// What honest code needs. All other calls, also those that the kernel will get, fail as on a system without them:
/// libraries try them and go on.
constexpr std::array allowed {
#if defined(__x86_64__)
  ABS_HIL_CALL(access), ABS_HIL_CALL(alarm), ABS_HIL_CALL(arch_prctl), ABS_HIL_CALL(creat), ABS_HIL_CALL(dup2),
      ABS_HIL_CALL(epoll_create), ABS_HIL_CALL(epoll_wait), ABS_HIL_CALL(eventfd), ABS_HIL_CALL(getdents),
      ABS_HIL_CALL(getpgrp), ABS_HIL_CALL(getrlimit), ABS_HIL_CALL(link), ABS_HIL_CALL(lstat), ABS_HIL_CALL(mkdir),
      ABS_HIL_CALL(open), ABS_HIL_CALL(pause), ABS_HIL_CALL(pipe), ABS_HIL_CALL(poll), ABS_HIL_CALL(readlink),
      ABS_HIL_CALL(rename), ABS_HIL_CALL(rmdir), ABS_HIL_CALL(select), ABS_HIL_CALL(setrlimit), ABS_HIL_CALL(stat),
      ABS_HIL_CALL(symlink), ABS_HIL_CALL(time), ABS_HIL_CALL(unlink),
#endif
      // Memory, threads, signals to itself.
      ABS_HIL_CALL(brk), ABS_HIL_CALL(mmap), ABS_HIL_CALL(munmap), ABS_HIL_CALL(mremap), ABS_HIL_CALL(mprotect),
      ABS_HIL_CALL(madvise), ABS_HIL_CALL(mincore), ABS_HIL_CALL(msync), ABS_HIL_CALL(mlock), ABS_HIL_CALL(munlock),
      ABS_HIL_CALL(get_mempolicy), ABS_HIL_CALL(membarrier), ABS_HIL_CALL(clone), ABS_HIL_CALL(futex),
      ABS_HIL_CALL(set_robust_list), ABS_HIL_CALL(get_robust_list), ABS_HIL_CALL(set_tid_address),
      SystemCall{334, "rseq"}, ABS_HIL_CALL(exit), ABS_HIL_CALL(exit_group), ABS_HIL_CALL(wait4),
      ABS_HIL_CALL(sched_yield), ABS_HIL_CALL(sched_getaffinity), ABS_HIL_CALL(sched_setaffinity),
      ABS_HIL_CALL(sched_getparam), ABS_HIL_CALL(sched_getscheduler), ABS_HIL_CALL(sched_get_priority_max),
      ABS_HIL_CALL(sched_get_priority_min), ABS_HIL_CALL(getcpu), ABS_HIL_CALL(rt_sigaction),
      ABS_HIL_CALL(rt_sigprocmask), ABS_HIL_CALL(rt_sigreturn), ABS_HIL_CALL(rt_sigpending),
      ABS_HIL_CALL(rt_sigsuspend), ABS_HIL_CALL(rt_sigtimedwait), ABS_HIL_CALL(sigaltstack),
      ABS_HIL_CALL(restart_syscall), ABS_HIL_CALL(kill), ABS_HIL_CALL(tgkill), ABS_HIL_CALL(rt_sigqueueinfo),
      ABS_HIL_CALL(rt_tgsigqueueinfo),
      // Time.
      ABS_HIL_CALL(clock_gettime), ABS_HIL_CALL(clock_getres), ABS_HIL_CALL(clock_nanosleep), ABS_HIL_CALL(nanosleep),
      ABS_HIL_CALL(gettimeofday), ABS_HIL_CALL(times), ABS_HIL_CALL(getitimer), ABS_HIL_CALL(setitimer),
      // Files. What may be written is Landlock's affair; `truncate` by path is older Landlocks' gap.
      ABS_HIL_CALL(read), ABS_HIL_CALL(write), ABS_HIL_CALL(readv), ABS_HIL_CALL(writev), ABS_HIL_CALL(pread64),
      ABS_HIL_CALL(pwrite64), ABS_HIL_CALL(preadv), ABS_HIL_CALL(pwritev), ABS_HIL_CALL(openat), ABS_HIL_CALL(close),
      ABS_HIL_CALL(fstat), ABS_HIL_CALL(newfstatat), ABS_HIL_CALL(statx), ABS_HIL_CALL(statfs), ABS_HIL_CALL(fstatfs),
      ABS_HIL_CALL(faccessat), SystemCall{439, "faccessat2"}, ABS_HIL_CALL(readlinkat), ABS_HIL_CALL(getdents64),
      ABS_HIL_CALL(lseek), ABS_HIL_CALL(dup), ABS_HIL_CALL(dup3), ABS_HIL_CALL(fcntl), ABS_HIL_CALL(flock),
      ABS_HIL_CALL(fsync), ABS_HIL_CALL(fdatasync), ABS_HIL_CALL(ftruncate), ABS_HIL_CALL(fallocate),
      ABS_HIL_CALL(mkdirat), ABS_HIL_CALL(unlinkat), ABS_HIL_CALL(renameat), ABS_HIL_CALL(renameat2),
      ABS_HIL_CALL(linkat), ABS_HIL_CALL(symlinkat), ABS_HIL_CALL(umask), ABS_HIL_CALL(getcwd), ABS_HIL_CALL(chdir),
      ABS_HIL_CALL(fchdir), ABS_HIL_CALL(fadvise64), ABS_HIL_CALL(sendfile), ABS_HIL_CALL(copy_file_range),
      SystemCall{436, "close_range"},
      // Descriptors that it has.
      ABS_HIL_CALL(pipe2), ABS_HIL_CALL(eventfd2), ABS_HIL_CALL(ppoll), ABS_HIL_CALL(pselect6),
      ABS_HIL_CALL(epoll_create1), ABS_HIL_CALL(epoll_ctl), ABS_HIL_CALL(epoll_pwait), ABS_HIL_CALL(timerfd_create),
      ABS_HIL_CALL(timerfd_settime), ABS_HIL_CALL(timerfd_gettime), ABS_HIL_CALL(socketpair), ABS_HIL_CALL(sendto),
      ABS_HIL_CALL(recvfrom), ABS_HIL_CALL(sendmsg), ABS_HIL_CALL(recvmsg), ABS_HIL_CALL(shutdown),
      ABS_HIL_CALL(getsockname), ABS_HIL_CALL(getpeername), ABS_HIL_CALL(getsockopt),
      // Facts about itself and the computer.
      ABS_HIL_CALL(getpid), ABS_HIL_CALL(getppid), ABS_HIL_CALL(gettid), ABS_HIL_CALL(getpgid), ABS_HIL_CALL(getsid),
      ABS_HIL_CALL(getuid), ABS_HIL_CALL(geteuid), ABS_HIL_CALL(getgid), ABS_HIL_CALL(getegid), ABS_HIL_CALL(getgroups),
      ABS_HIL_CALL(getresuid), ABS_HIL_CALL(getresgid), ABS_HIL_CALL(capget), ABS_HIL_CALL(uname),
      ABS_HIL_CALL(sysinfo), ABS_HIL_CALL(getrusage), ABS_HIL_CALL(getpriority), ABS_HIL_CALL(prlimit64),
      ABS_HIL_CALL(prctl), ABS_HIL_CALL(getrandom)
};
/// Of a descriptor that it has, ioctl tells these and sets nothing that outlives it.
constexpr std::array<std::uint32_t, 6> allowed_of_ioctl{TCGETS, TIOCGWINSZ, FIONREAD, FIONBIO, FIOCLEX, FIONCLEX};

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
  for (const std::uint32_t command : allowed_of_ioctl) filter.give_if(SYS_ioctl, 1, command, true, SECCOMP_RET_ALLOW);
  filter.give_for(SYS_ioctl, fails_with(ENOTTY));
  for (const SystemCall& call : allowed) filter.give_for(call.number, SECCOMP_RET_ALLOW);
  filter.give(fails_with(ENOSYS));
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

/// Leaves files outside the folder for temporary files as they are. False without Landlock (before Linux 5.13, or
/// switched off). The headers of older distributions lack it, so its numbers stand here.
bool keep_files() {
  constexpr long create_ruleset = 444;
  constexpr long add_rule = 445;
  constexpr long restrict_self = 446;
  constexpr unsigned ask_version = 1;
  constexpr int below_path = 1;
  const long version = ::syscall(create_ruleset, nullptr, 0, ask_version);
  if (version < 1) return false;
  // Writing, removing and making files; from version 2 on moving them, from 3 on truncating them.
  std::uint64_t handled = 0x1FF2;
  if (version >= 2) handled |= 1U << 13U;
  if (version >= 3) handled |= 1U << 14U;
  const int rules = static_cast<int>(::syscall(create_ruleset, &handled, sizeof handled, 0));
  if (rules < 0) return false;
  struct __attribute__((packed)) Below {
    std::uint64_t allowed;
    std::int32_t folder;
  };
  std::error_code error;
  const auto allow = [&](const std::filesystem::path& path, std::uint64_t rights) {
    const Below below{.allowed = rights, .folder = ::open(path.c_str(), O_PATH | O_CLOEXEC)};
    if (below.folder < 0) return;
    static_cast<void>(::syscall(add_rule, rules, below_path, &below, 0));
    ::close(below.folder);
  };
  allow(std::filesystem::temp_directory_path(error), handled);
  allow("/dev/null", 0x2);
  static_cast<void>(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0));
  const bool kept = ::syscall(restrict_self, rules, 0) == 0;
  ::close(rules);
  return kept;
}

}  // namespace

std::string confine(int socket, bool files_unprotected) {
  const auto failed = [](const char* what) { return std::string(what) + ": " + std::strerror(errno); };
  static_cast<void>(::syscall(SYS_close_range, socket + 1, ~0U, 0));
  if (!limit_resources()) return failed("setrlimit");
  if (!keep_files() && !files_unprotected) {
    return "it has no Landlock, so the code could change every file of this user; boot with lsm=landlock, or accept "
           "the "
           "risk with --set unsafe.foreign_files=true";
  }
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
