// The process that foreign code runs in: it answers steps until the other end closes. Takes files, network, processes
// and memory away from the code: seccomp, Landlock, rlimits.
#include "interchange/confinement.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <seccomp.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

namespace {

/// They end the code: a controller that asks for them wants something that it cannot have, and has to be told.
constexpr std::string_view forbidden =
    "fork vfork execve execveat tkill ptrace process_vm_readv process_vm_writev pidfd_send_signal sched_setscheduler "
    "sched_setparam sched_setattr setpriority ioprio_set unshare setns mount umount2 reboot";
/// What honest code needs. All other calls, also those that kernels will get, fail as on a system without them:
/// libraries try them and go on. Which files may be written is Landlock's affair; `truncate` is a gap of older ones.
constexpr std::string_view allowed =
    "brk mmap munmap mremap mprotect madvise mlock munlock futex rseq set_robust_list set_tid_address arch_prctl exit "
    "exit_group wait4 sched_yield sched_getaffinity sched_getparam sched_getscheduler sched_get_priority_max "
    "sched_get_priority_min getcpu membarrier rt_sigprocmask rt_sigreturn rt_sigsuspend sigaltstack restart_syscall "
    "pause alarm setitimer clock_gettime clock_getres clock_nanosleep nanosleep gettimeofday time times read write "
    "readv writev pread64 pwrite64 open openat close close_range fstat stat lstat newfstatat statx statfs fstatfs "
    "access faccessat faccessat2 readlink readlinkat getdents getdents64 lseek dup dup2 dup3 flock fsync fdatasync "
    "ftruncate fallocate mkdir mkdirat rmdir unlink unlinkat rename renameat renameat2 umask getcwd chdir fchdir pipe "
    "pipe2 eventfd2 poll ppoll select pselect6 epoll_create epoll_create1 epoll_ctl epoll_wait epoll_pwait socketpair "
    "sendto recvfrom sendmsg recvmsg shutdown getsockname getpeername getsockopt getpid getppid gettid getpgrp getuid "
    "geteuid getgid getegid getgroups getresuid getresgid uname sysinfo getrusage getrlimit setrlimit getrandom "
    "seccomp";

Offences trapped;
int answers_to = -1;
bool counting = false;

void on_trap(int /*signal*/, siginfo_t* info, void* context) {
  if (!counting) {
    const HostRefusal refusal{.system_call = info->si_syscall};
    static_cast<void>(::send(answers_to, &refusal, sizeof refusal, MSG_NOSIGNAL));
    ::_exit(1);
  }
  if (trapped.system_calls++ == 0) trapped.first_system_call = info->si_syscall;
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
  Filter filter(SCMP_ACT_ERRNO(ENOSYS));
  filter.give(ends, forbidden);
  filter.give(SCMP_ACT_ALLOW, allowed);
  // A rule for all of a call's values would displace those for some.
  for (const std::uint64_t is_thread : {std::uint64_t{0}, thread}) {
    const scmp_arg_cmp flags{0, SCMP_CMP_MASKED_EQ, thread, is_thread};
    filter.give(is_thread != 0 ? SCMP_ACT_ALLOW : ends, "clone", {&flags, 1});
  }
  // Honest libraries ask whether there is a network (Python's), or local services for names of users (the C library's).
  filter.give(SCMP_ACT_ERRNO(EACCES), "socket");
  constexpr std::string_view signals = "kill tgkill rt_sigqueueinfo rt_tgsigqueueinfo";
  filter.give_if(ends, signals, 0, own, false);
  filter.give_if(SCMP_ACT_ALLOW, signals, 0, own);
  filter.give_if(ends, "prlimit64", 0, 0, false);
  filter.give_if(SCMP_ACT_ERRNO(EPERM), "sched_setaffinity", 0, 0, false);
  filter.give_if(SCMP_ACT_ALLOW, "prlimit64 sched_setaffinity", 0, 0);
  filter.give_if(ends, "prctl", 0, PR_SET_PDEATHSIG);
  constexpr std::uint32_t last_signal = 64;
  for (std::uint32_t number = 1; number <= last_signal; ++number) {
    filter.give_if(number == SIGSYS ? SCMP_ACT_ERRNO(EPERM) : SCMP_ACT_ALLOW, "rt_sigaction", 0, number);
  }
  // Signals to the owner of a descriptor would reach other processes.
  for (const std::uint32_t command : {F_SETOWN, F_SETSIG, F_SETOWN_EX}) filter.give_if(ends, "fcntl", 1, command);
  for (const std::uint32_t command : {set_owner, set_group}) filter.give_if(ends, "ioctl", 1, command);
  const auto allow = [&filter](std::string_view call, unsigned n, std::initializer_list<std::uint32_t> values) {
    for (const std::uint32_t value : values) filter.give_if(SCMP_ACT_ALLOW, call, n, value);
  };
  allow("prctl", 0, {PR_SET_NAME, PR_GET_NAME, PR_SET_NO_NEW_PRIVS, PR_GET_SECCOMP, PR_SET_SECCOMP});
  allow("fcntl", 1, {F_DUPFD, F_DUPFD_CLOEXEC, F_GETFD, F_SETFD, F_GETFL, F_SETFL, F_GETLK, F_SETLK, F_SETLKW});
  allow("ioctl", 1, {TCGETS, TIOCGWINSZ, FIONREAD, FIONBIO, FIOCLEX, FIONCLEX});
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
  const auto allow = [&](const std::filesystem::path& path, std::uint64_t rights) {
    const Below below{.allowed = rights, .folder = ::open(path.c_str(), O_PATH | O_CLOEXEC)};
    if (below.folder < 0) return;
    static_cast<void>(::syscall(add_rule, rules, below_path, &below, 0));
    ::close(below.folder);
  };
  allow(temporary_folder(), handled);
  allow("/dev/null", 0x2);
  static_cast<void>(::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0));
  const bool kept = ::syscall(restrict_self, rules, 0) == 0;
  ::close(rules);
  return kept;
}

bool send_packet(const void* data, std::size_t size) {
  return ::send(host_socket, data, size, MSG_NOSIGNAL) == static_cast<ssize_t>(size);
}

bool send_json(const nlohmann::json& json) {
  const std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return send_packet(text.data(), text.size());
}

/// Trial steps of code that is warm, with an eye on what it asks of the system. Its system calls are not done.
Offences probe(ForeignCode& code, const HostRequest& request, const std::function<std::uint64_t()>& allocations) {
  constexpr std::int64_t warming = 200;
  static_cast<void>(warm_up(code, request.period_s, warming));
  code.reset(trial_input(0, request.period_s));
  if (!trap_system_calls(host_socket)) return {};
  const std::uint64_t before = allocations();
  for (std::int64_t step = 0; step < request.count; ++step) {
    abs_hil_output output = no_output();
    code.step(trial_input(step, request.period_s), output);
  }
  Offences found = trapped_system_calls();
  found.allocations = allocations() - before;
  return found;
}

}  // namespace

std::filesystem::path temporary_folder() {
  const char* given = std::getenv("TMPDIR");
  return std::filesystem::absolute(given != nullptr && *given != '\0' ? given : "/tmp");
}

std::string confine(int socket, bool files_unprotected) {
  const auto failed = [](const char* what) { return std::string(what) + ": " + std::strerror(errno); };
  static_cast<void>(::syscall(SYS_close_range, socket + 1, ~0U, 0));
  if (!limit_resources()) return failed("setrlimit");
  if (!keep_files() && !files_unprotected) {
    return "it has no Landlock, so that code could change every file of this user; boot with lsm=landlock, or accept "
           "the risk with --set unsafe.foreign_files=true";
  }
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

Offences trapped_system_calls() noexcept { return trapped; }

int run_host(const std::function<std::unique_ptr<ForeignCode>(const ForeignSetup&)>& make,
             const std::function<std::uint64_t()>& allocations) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);  // what foreign code prints must not mix with the program's results
  std::string packet(host_packet_max, '\0');
  const ssize_t size = ::recv(host_socket, packet.data(), packet.size(), 0);
  if (size <= 0) return 2;
  packet.resize(static_cast<std::size_t>(size));
  std::unique_ptr<ForeignCode> code;
  try {
    const auto setup = nlohmann::json::parse(packet).get<ForeignSetup>();
    if (const std::string why = confine(host_socket, setup.files_unprotected); !why.empty()) {
      throw std::runtime_error("this kernel cannot confine a controller from a file (" + why + ")");
    }
    code = make(setup);
  } catch (const std::exception& error) {
    static_cast<void>(send_json({{"error", error.what()}}));
    return 2;
  }
  if (!send_json({{"signals", code->signals()}, {"source", code->source()}})) return 2;
  HostRequest request;
  while (::recv(host_socket, &request, sizeof request, 0) == static_cast<ssize_t>(sizeof request)) {
    HostAnswer answer{.output = no_output()};
    switch (request.action) {
      case HostAction::reset: code->reset(request.input); break;
      case HostAction::step: code->step(request.input, answer.output); break;
      case HostAction::warm_up: answer.times = warm_up(*code, request.period_s, request.count); break;
      case HostAction::probe:
        answer.offences = probe(*code, request, allocations);
        static_cast<void>(send_packet(&answer, sizeof answer));
        ::_exit(0);  // no system call but this one is done any more
    }
    // A step that works costs no text.
    if (request.action != HostAction::step || std::isnan(answer.output.brake_torque_Nm)) {
      code->failure().copy(answer.failure.data(), answer.failure.size() - 1);
    }
    if (!send_packet(&answer, sizeof answer)) break;
  }
  return 0;
}

}  // namespace abs_hil::interchange
