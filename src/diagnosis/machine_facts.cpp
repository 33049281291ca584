// Reads what of kernel, clock and processors affects timing.
#include "diagnosis/machine_facts.hpp"

#include <cstdlib>
#include <set>

#include "driver/sysfs.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::diagnosis {

namespace {

namespace fs = std::filesystem;
const std::string unknown = "unknown";

/// First line of a small file without trailing blanks; `otherwise` if it is empty or cannot be read.
std::string first_line(const fs::path& file, const std::string& otherwise = {}) {
  std::string line = driver::line_in(file);
  line.erase(line.find_last_not_of(" \t\r\n") + 1);
  return line.empty() ? otherwise : line;
}

/// "none voluntary (full)" -> "full": the kernel marks the active choice by parentheses.
std::string chosen(const std::string& choices) {
  const auto from = choices.find('(');
  const auto to = choices.find(')', from);
  return from == std::string::npos || to == std::string::npos ? "" : choices.substr(from + 1, to - from - 1);
}

std::string preemption_model(const fs::path& root) {
  if (first_line(root / "sys/kernel/realtime") == "1") return "PREEMPT_RT";  // only PREEMPT_RT kernels have this file
  const std::string version = first_line(root / "proc/sys/kernel/version");
  if (version.find("PREEMPT_RT") != std::string::npos) return "PREEMPT_RT";
  if (version.find("PREEMPT_DYNAMIC") != std::string::npos) {
    const std::string mode = chosen(first_line(root / "sys/kernel/debug/sched/preempt"));
    return mode.empty() ? "dynamic, mode unknown" : mode;
  }
  return version.find("PREEMPT") != std::string::npos ? "full" : version.empty() ? unknown : "none or voluntary";
}

std::string governors(const fs::path& root) {
  std::set<std::string> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(root / "sys/devices/system/cpu", ignored)) {
    if (const std::string name = first_line(entry.path() / "cpufreq/scaling_governor"); !name.empty()) {
      found.insert(name);
    }
  }
  return found.empty() ? "none" : rig::joined({found.begin(), found.end()});
}

Finding kernel_finding(const MachineFacts& facts) {
  Finding f{.check = "kernel", .what = "kernel " + facts.kernel, .detail = "preemption: " + facts.preemption};
  if (facts.preemption != "PREEMPT_RT") {
    f.standing = Standing::warning;
    f.fix = "sudo apt install linux-image-rt-amd64   # then reboot into it";
    f.detail += "; without PREEMPT_RT a busy kernel delays wake-ups by milliseconds";
  }
  return f;
}

Finding clock_finding(const MachineFacts& facts) {
  Finding f{.check = "clock", .what = "clock source " + facts.clock_source};
  // All other clock sources need a system call of a microsecond and more: vdso(7), arch/x86/include/asm/vdso.
  for (const std::string_view quick : {"tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter"}) {
    if (facts.clock_source == quick) return f;
  }
  f.standing = Standing::warning;
  f.detail = "reading it takes a system call, five times per cycle";
  f.fix =
      "cat /sys/devices/system/clocksource/clocksource0/available_clocksource\n"
      "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource";
  return f;
}

Finding governor_finding(const MachineFacts& facts) {
  Finding f{.check = "cpu", .what = "CPU governor " + facts.governor};
  if (facts.governor == "none") {
    f.standing = Standing::note;
    f.detail = "frequencies are not scaled by this kernel";
  } else if (facts.governor != "performance") {
    f.standing = Standing::warning;
    f.detail = "a CPU frequency that changes with the load makes the cycle time vary";
    f.fix = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor";
  }
  return f;
}

Finding isolation_finding(const MachineFacts& facts) {
  Finding f{.check = "cpu", .what = "isolated CPUs: " + facts.isolated_cpus, .standing = Standing::note};
  f.detail = "of " + facts.online_cpus;
  if (facts.isolated_cpus == "none") {
    f.detail +=
        "; an isolated CPU keeps other work away from the cycle: kernel parameters isolcpus=N nohz_full=N "
        "rcu_nocbs=N, then --set realtime.cpu=N";
  }
  return f;
}

}  // namespace

MachineFacts read_machine_facts(const fs::path& root) {
  const fs::path cpus = root / "sys/devices/system/cpu";
  const fs::path clock = root / "sys/devices/system/clocksource/clocksource0/current_clocksource";
  return {.kernel = first_line(root / "proc/sys/kernel/osrelease", unknown),
          .preemption = preemption_model(root),
          .clock_source = first_line(clock, unknown),
          .governor = governors(root),
          .isolated_cpus = first_line(cpus / "isolated", "none"),
          .online_cpus = first_line(cpus / "online", unknown),
          .cpu_model = driver::value_in(root / "proc/cpuinfo", "model name"),
          .virtual_machine = driver::value_in(root / "proc/cpuinfo", "flags").find(" hypervisor") != std::string::npos,
          .load_1min = std::strtod(first_line(root / "proc/loadavg").c_str(), nullptr)};
}

std::vector<Finding> judge(const MachineFacts& facts) {
  std::vector<Finding> findings{kernel_finding(facts), clock_finding(facts), governor_finding(facts),
                                isolation_finding(facts)};
  if (facts.virtual_machine) {
    findings.push_back({.check = "cpu",
                        .what = "this is a virtual machine",
                        .standing = Standing::note,
                        .detail = "the host decides when it runs, so the worst latencies are those of the host"});
  }
  return findings;
}

}  // namespace abs_hil::diagnosis
