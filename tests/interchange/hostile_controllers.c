/* Controllers that attack, one for each value of HOSTILE. The number of the deed is a constant of the library; its place
 * (constructor, create, step 100) is another. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "abs_hil/interchange/controller.h"

ABS_HIL_CONTROLLER_INTERFACE;

static void* wait_for_ever(void* nothing) {
  for (;;) pause();
  return nothing;
}

static void* exit_there(void* nothing) {
  exit(0);
  return nothing;
}

static void do_it(void) {
#if defined(FORK_BOMB)
  for (;;) fork();
#elif defined(DAEMON)
  if (fork() == 0) {
    setsid();
    for (;;) pause();
  }
#elif defined(CLONE_RAW)
  syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0);
#elif defined(SHELL)
  execl("/bin/sh", "sh", "-c", "sleep 1000", (char*)0);
#elif defined(SYSTEM)
  system("true");
#elif defined(THREADS)
  pthread_attr_t small;
  pthread_t thread;
  pthread_attr_init(&small);
  pthread_attr_setstacksize(&small, 16384);
  for (;;) pthread_create(&thread, &small, wait_for_ever, NULL);
#elif defined(MEMORY)
  for (;;) memset(malloc(1 << 26), 1, 1 << 12);
#elif defined(SHARED_MEMORY)
  for (;;) {
    char* block = mmap(NULL, 1 << 28, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    *block = 1;
  }
#elif defined(SEGMENT)
  if (shmget(IPC_PRIVATE, 1 << 20, 0600) < 0) abort();
#elif defined(BIG_FILE)
  const int file = open(getenv("HOSTILE_BIG_FILE"), O_WRONLY | O_CREAT, 0600);
  static char block[1 << 20];
  while (write(file, block, sizeof block) > 0) {
  }
  abort();
#elif defined(DELETES)
  const char* file = getenv("HOSTILE_FILE");
  if (open(file, O_WRONLY | O_TRUNC) < 0 && unlink(file) < 0 && truncate(file, 0) < 0 && chmod(file, 0) < 0 &&
      rename(file, "/tmp/gone") < 0)
    abort();
#elif defined(SWEEP)
  /* All system calls, also those that this C library does not know, with the file where calls have one. Those that end
     the process, or wait for ever, are left out. */
  const char* file = getenv("HOSTILE_FILE");
  static const int without[] = {SYS_fork, SYS_vfork, SYS_clone, SYS_execve, SYS_execveat, SYS_exit, SYS_exit_group,
      SYS_kill, SYS_tkill, SYS_tgkill, SYS_ptrace, SYS_process_vm_readv, SYS_process_vm_writev, SYS_pidfd_send_signal,
      SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo, SYS_sched_setscheduler, SYS_sched_setparam, SYS_sched_setattr,
      SYS_setpriority, SYS_ioprio_set, SYS_unshare, SYS_setns, SYS_mount, SYS_umount2, SYS_reboot, SYS_prlimit64,
      SYS_rt_sigreturn, SYS_pause, SYS_rt_sigsuspend, SYS_restart_syscall, SYS_alarm, SYS_setitimer, SYS_arch_prctl,
      SYS_brk, SYS_close_range, SYS_rt_sigprocmask, SYS_rt_sigtimedwait, SYS_futex, SYS_set_tid_address,
      SYS_set_robust_list, SYS_sigaltstack, SYS_select, SYS_pselect6, SYS_ppoll, SYS_seccomp};
  for (long call = 0; call <= 600; ++call) {
    int skip = 0;
    for (size_t i = 0; i < sizeof without / sizeof *without; ++i) skip |= without[i] == call;
    if (skip || call == 335 || call == 336) continue; /* uretprobe, uprobe: no filter sees them, and they end the process */
    const int opened = open(file, O_RDONLY);
    static char room[4096]; /* zeros: times, attributes, modes */
    struct { unsigned long long value; unsigned size, flags; } attribute = {(unsigned long long)(size_t)"x", 1, 0};
    syscall(call, file, 0, 0, 0, 0, 0);
    syscall(call, file, "/tmp/abs_hil_swept", 0, 0, 0, 0);
    syscall(call, file, "user.swept", "x", 1, 0, 0);
    syscall(call, file, room, 0, 0, 0, 0);
    syscall(call, AT_FDCWD, file, 0, 0, 0, 0);
    syscall(call, AT_FDCWD, file, room, 0, 0, 0);
    syscall(call, AT_FDCWD, file, 0, "user.swept", &attribute, sizeof attribute);
    syscall(call, AT_FDCWD, file, AT_FDCWD, "/tmp/abs_hil_swept", 0, 0);
    if (opened > 3) {
      syscall(call, opened, 0, 0, 0, 0, 0);
      syscall(call, opened, "", 0, "user.swept", &attribute, sizeof attribute);
      syscall(call, opened, "user.swept", "x", 1, 0, 0);
      syscall(call, opened, 0x40086602 /* FS_IOC_SETFLAGS */, room, 0, 0, 0);
      close(opened);
    }
  }
  abort();
#elif defined(ESCAPES)
  fputs("red \033[31m bell \007 title \033]0;owned\007 csi \302\233 umlaut \303\274\n", stderr);
  abort();
#elif defined(CLOSES)
  for (int i = 0; i < 1024; ++i) close(i);
  for (;;) pause();
#elif defined(FORGES)
  send(3, "[[[[[[[[[[", 10, 0);
  for (;;) pause();
#elif defined(PRINTS)
  static char text[65536];
  memset(text, 'x', sizeof text);
  for (;;) {
    if (write(1, text, sizeof text) < 0 || write(2, text, sizeof text) < 0) abort();
  }
#elif defined(KILLS_PARENT)
  kill(getppid(), SIGKILL);
#elif defined(STOPS_PARENT)
  kill(getppid(), SIGSTOP);
#elif defined(KILLS_ALL)
  kill(-1, SIGKILL);
#elif defined(SIGNALS_BY_OWNER)
  fcntl(3, F_SETOWN, getppid());
#elif defined(LEAVES_PARENT)
  prctl(PR_SET_PDEATHSIG, 0);
#elif defined(STOPS_ITSELF)
  raise(SIGSTOP);
#elif defined(TRACES)
  ptrace(PTRACE_ATTACH, getppid(), 0, 0);
#elif defined(LIMITS_PARENT)
  const struct rlimit none = {0, 0};
  prlimit(getppid(), RLIMIT_NOFILE, &none, NULL);
#elif defined(NETWORK)
  if (socket(AF_INET, SOCK_STREAM, 0) < 0) abort();
#elif defined(OTHER_SOCKETS)
  if (socket(AF_NETLINK, SOCK_RAW, 0) < 0 && socket(AF_UNIX, SOCK_STREAM, 0) < 0) abort();
#elif defined(PRIORITY)
  const struct sched_param most = {.sched_priority = 99};
  sched_setscheduler(0, SCHED_FIFO, &most);
#elif defined(NAMESPACE)
  unshare(CLONE_NEWUSER);
#elif defined(EXITS)
  exit(0);
#elif defined(EXITS_AT_ONCE)
  _exit(0);
#elif defined(EXITS_QUICKLY)
  quick_exit(0);
#elif defined(EXITS_IN_THREAD)
  pthread_t thread;
  pthread_create(&thread, NULL, exit_there, NULL);
#elif defined(ENDS_THREAD)
  pthread_exit(NULL);
#elif defined(ABORTS)
  abort();
#elif defined(LOOPS)
  for (;;) {
  }
#elif defined(SLOW)
  usleep(1000000);
#endif
}

#if defined(IN_CONSTRUCTOR)
__attribute__((constructor)) static void construct(void) { do_it(); }
#endif

static int steps;

void* abs_hil_controller_create(const abs_hil_setup* setup, char* error, size_t error_size) {
  (void)setup;
  (void)error;
  (void)error_size;
#if defined(IN_CREATE)
  do_it();
#endif
  return &steps;
}
void abs_hil_controller_reset(void* controller, const abs_hil_input* input) {
  (void)controller;
  (void)input;
}
void abs_hil_controller_step(void* controller, const abs_hil_input* input, abs_hil_output* output) {
  (void)controller;
  output->brake_torque_Nm = 4.0 * (input->slip_ref - input->slip) + 2.0;
  ++steps;
#if defined(AT_STEP)
  /* Late deeds come after the trials before a run in real time. */
  if (steps >= AT_STEP) do_it();
#endif
}
const char* abs_hil_controller_signal(void* controller, uint32_t index) {
  (void)controller;
  (void)index;
  return NULL;
}
void abs_hil_controller_destroy(void* controller) { (void)controller; }
