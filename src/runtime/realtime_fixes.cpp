#include "runtime/realtime_fixes.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <array>

namespace abs_hil::runtime {

namespace {

/// This program, and the guardian beside it: a guardian with fewer rights than its controller is refused.
std::string program_paths() {
  std::array<char, 4096> path{};
  const ssize_t size = ::readlink("/proc/self/exe", path.data(), path.size());
  if (size <= 0) return "$(command -v abs_hil) $(command -v abs_guardian)";
  const std::string program(path.data(), static_cast<std::size_t>(size));
  const std::string guardian = program.substr(0, program.rfind('/') + 1) + "abs_guardian";
  const bool has_guardian = guardian != program && ::access(guardian.c_str(), F_OK) == 0;
  return has_guardian ? program + " " + guardian : program;
}

}  // namespace

std::string privilege_fix() {
  return "sudo groupadd -f realtime && sudo usermod -aG realtime $USER\n"
         "printf '@realtime - rtprio 98\\n@realtime - memlock unlimited\\n' | sudo tee "
         "/etc/security/limits.d/99-realtime.conf   # then log in again\n"
         "or, for these programs alone: sudo setcap cap_sys_nice,cap_ipc_lock+ep " +
         program_paths();
}

std::string fifo_fix(int priority) {
  rlimit limit{};
  if (getrlimit(RLIMIT_RTPRIO, &limit) == 0 && limit.rlim_cur > 0 && limit.rlim_cur < static_cast<rlim_t>(priority)) {
    return "--set realtime.priority=" + std::to_string(limit.rlim_cur) + ", which the limit allows, or:\n" +
           privilege_fix();
  }
  if (::geteuid() == 0) {
    // Root can fail in a container without CAP_SYS_NICE, or in a control group without real-time bandwidth.
    return "in a container: docker run --cap-add SYS_NICE --cap-add IPC_LOCK --ulimit rtprio=98 --ulimit memlock=-1 "
           "...\n"
           "in a control group without real-time bandwidth: sudo sysctl -w kernel.sched_rt_runtime_us=-1\n" +
           privilege_fix();
  }
  return privilege_fix();
}

std::string cpu_latency_fix() {
  return "echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\"' | sudo tee "
         "/etc/udev/rules.d/99-cpu-dma-latency.rules\n"
         "sudo udevadm control --reload && sudo udevadm trigger --name-match=cpu_dma_latency";
}

}  // namespace abs_hil::runtime
