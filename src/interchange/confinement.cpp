// Takes files, network, processes and memory away from foreign code: seccomp, Landlock, rlimits.
#include "interchange/confinement.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>

#include "interchange/host.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

namespace {

/// They end the code: a controller that asks for them wants something that it cannot have, and has to be told.
constexpr std::string_view forbidden =
    "fork vfork execve execveat tkill ptrace process_vm_readv process_vm_writev pidfd_send_signal sched_setscheduler "
    "sched_setparam sched_setattr setpriority ioprio_set unshare setns mount umount2 reboot";
/// They fail as they do on a system without them. Honest libraries try them and go on. They could reach around the
/// limits, outlive the process, or change files that cannot be written.
constexpr std::string_view absent =
    "clone3 io_uring_setup memfd_create shmget msgget semget mq_open bpf perf_event_open pidfd_getfd keyctl add_key "
    "userfaultfd chmod fchmod fchmodat chown lchown fchown fchownat setxattr lsetxattr fsetxattr";

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

/// A filter of system calls (libseccomp). What calls by the numbers of another architecture is killed.
class Filter {
 public:
  explicit Filter(std::uint32_t otherwise) : context_(::seccomp_init(otherwise), ::seccomp_release) {
    made_ = context_ && ::seccomp_attr_set(context_.get(), SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS) == 0;
  }
  /// For these calls, if an argument is as told. A call that this architecture lacks needs no rule.
  void give(std::uint32_t verdict, std::string_view calls, std::span<const scmp_arg_cmp> argument = {}) {
    for (const std::string_view call : rig::split(calls, ' ')) {
      const int number = ::seccomp_syscall_resolve_name(std::string(call).c_str());
      made_ = made_ && number != __NR_SCMP_ERROR &&
              ::seccomp_rule_add_array(context_.get(), verdict, number, static_cast<unsigned>(argument.size()),
                                       argument.data()) == 0;
    }
  }
  /// For these calls, if their argument `n`, of 32 bits, equals a value, or does not.
  void give_if(std::uint32_t verdict, std::string_view calls, unsigned n, std::uint32_t value, bool equal = true) {
    const auto is =
        equal ? scmp_arg_cmp{n, SCMP_CMP_MASKED_EQ, ~std::uint32_t{0}, value} : scmp_arg_cmp{n, SCMP_CMP_NE, value, 0};
    give(verdict, calls, {&is, 1});
  }
  [[nodiscard]] bool install() { return made_ && ::seccomp_load(context_.get()) == 0; }

 private:
  std::unique_ptr<void, void (*)(void*)> context_;
  bool made_{false};
};

bool filter_calls() {
  const auto own = static_cast<std::uint32_t>(::getpid());
  constexpr std::uint64_t thread = 0x0001'0000;  // CLONE_THREAD
  constexpr std::uint32_t set_owner = 0x8901;    // FIOSETOWN
  constexpr std::uint32_t set_group = 0x8902;    // SIOCSPGRP
  constexpr std::uint32_t ends = SCMP_ACT_TRAP;
  Filter filter(SCMP_ACT_ALLOW);
  filter.give(ends, forbidden);
  filter.give(SCMP_ACT_ERRNO(ENOSYS), absent);
  const scmp_arg_cmp no_thread{0, SCMP_CMP_MASKED_EQ, thread, 0};
  filter.give(ends, "clone", {&no_thread, 1});
  // Honest libraries ask whether there is a network (Python's), or local services for names of users (the C library's).
  filter.give(SCMP_ACT_ERRNO(EACCES), "socket");
  filter.give_if(ends, "kill tgkill rt_sigqueueinfo rt_tgsigqueueinfo", 0, own, false);
  filter.give_if(ends, "prlimit64", 0, 0, false);
  filter.give_if(SCMP_ACT_ERRNO(EPERM), "sched_setaffinity", 0, 0, false);
  filter.give_if(ends, "prctl", 0, PR_SET_PDEATHSIG);
  filter.give_if(SCMP_ACT_ERRNO(EPERM), "rt_sigaction", 0, SIGSYS);
  // Signals to the owner of a descriptor would reach other processes.
  for (const std::uint32_t command : {F_SETOWN, F_SETSIG, F_SETOWN_EX}) filter.give_if(ends, "fcntl", 1, command);
  for (const std::uint32_t command : {set_owner, set_group}) filter.give_if(ends, "ioctl", 1, command);
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
  const auto allow = [&](const std::filesystem::path& path, std::uint64_t allowed) {
    const Below below{.allowed = allowed, .folder = ::open(path.c_str(), O_PATH | O_CLOEXEC)};
    if (below.folder < 0) return;
    static_cast<void>(::syscall(add_rule, rules, below_path, &below, 0));
    ::close(below.folder);
  };
  allow(temporary_folder(), handled);
  allow("/dev/null", 0x2);
  static_cast<void>(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0));
  static_cast<void>(::syscall(restrict_self, rules, 0));
  ::close(rules);
}

}  // namespace

std::filesystem::path temporary_folder() {
  const char* given = std::getenv("TMPDIR");
  return std::filesystem::absolute(given != nullptr && *given != '\0' ? given : "/tmp");
}

std::string confine(int socket) {
  const auto failed = [](const char* what) { return std::string(what) + ": " + std::strerror(errno); };
  static_cast<void>(::syscall(SYS_close_range, socket + 1, ~0U, 0));
  if (!limit_resources()) return failed("setrlimit");
  keep_files();
  if (!drop_capabilities()) return failed("capset");
  if (!catch_traps(socket) || !filter_calls()) return failed("seccomp");
  return {};
}

std::string name_of_call(std::int32_t number) {
  const std::unique_ptr<char, void (*)(void*)> name(::seccomp_syscall_resolve_num_arch(SCMP_ARCH_NATIVE, number),
                                                    std::free);
  return name ? name.get() : "another one";
}

bool trap_system_calls(int socket) {
  counting = true;
  if (answers_to < 0 && !catch_traps(socket)) return false;
  Filter filter(SCMP_ACT_TRAP);
  // The C library asks for memory by some of these; what the code allocates is counted elsewhere.
  filter.give(SCMP_ACT_ALLOW, "exit_group rt_sigreturn brk mmap munmap");
  filter.give_if(SCMP_ACT_ALLOW, "sendto", 0, static_cast<std::uint32_t>(socket));
  return filter.install();
}

TrappedSystemCalls trapped_system_calls() noexcept { return trapped; }

}  // namespace abs_hil::interchange
