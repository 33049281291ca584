// Reads what of kernel, clock and processors affects timing; grades what `abs_hil latency` measured, as text and JSON.
#include "diagnosis/machine_facts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "driver/sysfs.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::diagnosis {

namespace fs = std::filesystem;

namespace {

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

std::string_view name_of(Grade grade) {
  constexpr std::array<std::string_view, 4> names{"very good", "good", "usable", "unfit"};
  return names[static_cast<std::size_t>(grade)];
}

Grade grade_jitter(double worst_us) noexcept {
  if (worst_us < 20.0) return Grade::very_good;
  if (worst_us <= 50.0) return Grade::good;
  return worst_us <= 500.0 ? Grade::usable : Grade::unfit;  // NaN is unfit
}

Grade grade_in_time(double share) noexcept {
  if (share >= 1.0) return Grade::very_good;
  return share >= 0.95 ? Grade::usable : Grade::unfit;
}

Grade grade_left(double share) noexcept {
  if (share >= 0.8) return Grade::very_good;
  return share > 0.0 ? Grade::usable : Grade::unfit;
}

std::string quantiles_text(const rig::DurationQuantiles& q) {
  return fmt::format("p50 {:>6.0f}   p99 {:>6.0f}   p99.9 {:>6.0f}   max {:>8.1f} us", q.p50_us, q.p99_us, q.p99_9_us,
                     q.max_us);
}

nlohmann::ordered_json quantiles_json(const rig::DurationQuantiles& q) {
  return {{"p50", q.p50_us}, {"p99", q.p99_us}, {"p99_9", q.p99_9_us}, {"max", q.max_us}};
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

Verdict judge(const LatencyRun& run) noexcept {
  Verdict v;
  const rig::TimingSummary& t = run.timing;
  const double period_us = 1e6 / run.rate_Hz;
  const auto cycles = static_cast<double>(run.cycles);
  const auto missed = static_cast<double>(t.overruns.ticks_missed);
  v.jitter = grade_jitter(t.wakeup_latency.max_us);
  v.in_time = run.cycles == 0 ? 0.0 : cycles / (cycles + missed);
  const double left = 1.0 - (t.wakeup_latency.max_us + t.cycle_time.p99_9_us) / period_us;
  v.left_for_control = std::isfinite(left) ? std::max(0.0, left) : 0.0;
  v.overall = std::max({v.jitter, grade_in_time(v.in_time), grade_left(v.left_for_control)});
  return v;
}

std::string to_text(const LatencyRun& run, const MachineFacts& facts) {
  const Verdict v = judge(run);
  const rig::TimingSummary& t = run.timing;
  std::string text;
  const auto line = [&text](std::string_view name, const std::string& value) {
    text += fmt::format("  {:<18}{}\n", name, value);
  };
  text += fmt::format("{} cycles at {:.0f} Hz, {}\n", run.cycles, run.rate_Hz,
                      run.realtime ? "in real time" : "NOT in real time (abs_hil doctor gives the reason)");
  line("wake-up latency", quantiles_text(t.wakeup_latency));
  line("read", quantiles_text(t.read));
  if (run.wire) {
    line("  of it the wire", fmt::format("from request to answer {:.1f} us on average, {:.1f} us at most, {} answers",
                                         run.wire->mean_us, run.wire->longest_us, run.wire->answers));
  }
  line("control", quantiles_text(t.control));
  line("write", quantiles_text(t.write));
  line("cycle time", quantiles_text(t.cycle_time));
  line("ticks missed", fmt::format("{} in {} late cycles; wakeup {}, read {}, control {}, write {}, record {}",
                                   t.overruns.ticks_missed, t.overruns.total, t.overruns.of(rig::OverrunCause::wakeup),
                                   t.overruns.of(rig::OverrunCause::read), t.overruns.of(rig::OverrunCause::control),
                                   t.overruns.of(rig::OverrunCause::write), t.overruns.of(rig::OverrunCause::record)));
  text += fmt::format("verdict: {}\n", name_of(v.overall));
  line("jitter", fmt::format("{}: worst wake-up {:.1f} us (LinuxCNC: below 20 very nice, 20-50 good, above 500 "
                             "unacceptable)",
                             name_of(v.jitter), t.wakeup_latency.max_us));
  line("in time", fmt::format("{:.3f} % of the ticks (libfranka warns below 95 %)", 100.0 * v.in_time));
  line("left for control", fmt::format("{:.1f} % of the period after the worst wake-up and p99.9 of the cycle "
                                       "(ros2_control's users ask for 80 %)",
                                       100.0 * v.left_for_control));
  text += "machine\n";
  line("kernel", facts.kernel + ", preemption " + facts.preemption);
  line("CPU", fmt::format("{}{}, online {}, isolated {}, governor {}", facts.cpu_model,
                          facts.virtual_machine ? " (virtual machine)" : "", facts.online_cpus, facts.isolated_cpus,
                          facts.governor));
  line("clock source", facts.clock_source);
  line("load", fmt::format("{:.2f} over the last minute", facts.load_1min));
  return text;
}

nlohmann::ordered_json to_json(const LatencyRun& run, const MachineFacts& facts) {
  const Verdict v = judge(run);
  const rig::TimingSummary& t = run.timing;
  nlohmann::ordered_json causes = nlohmann::ordered_json::object();
  for (std::size_t i = 1; i < rig::overrun_cause_count; ++i) {
    causes[std::string(rig::name_of(static_cast<rig::OverrunCause>(i)))] = t.overruns.by_cause[i];
  }
  nlohmann::ordered_json wire;  // null for a board that answers at once
  if (run.wire) {
    wire = {{"answers", run.wire->answers}, {"mean", run.wire->mean_us}, {"max", run.wire->longest_us}};
  }
  return {{"rate_Hz", run.rate_Hz},
          {"duration_s", run.duration_s},
          {"cycles", run.cycles},
          {"realtime", run.realtime},
          {"wakeup_latency_us", quantiles_json(t.wakeup_latency)},
          {"read_us", quantiles_json(t.read)},
          {"wire_us", wire},
          {"control_us", quantiles_json(t.control)},
          {"write_us", quantiles_json(t.write)},
          {"cycle_time_us", quantiles_json(t.cycle_time)},
          {"overruns", t.overruns.total},
          {"overruns_by_cause", causes},
          {"overruns_startup", t.overruns.startup},
          {"ticks_missed", t.overruns.ticks_missed},
          {"verdict",
           {{"overall", std::string(name_of(v.overall))},
            {"jitter", std::string(name_of(v.jitter))},
            {"in_time", v.in_time},
            {"left_for_control", v.left_for_control}}},
          {"machine",
           {{"kernel", facts.kernel},
            {"preemption", facts.preemption},
            {"cpu", facts.cpu_model},
            {"virtual_machine", facts.virtual_machine},
            {"online_cpus", facts.online_cpus},
            {"isolated_cpus", facts.isolated_cpus},
            {"governor", facts.governor},
            {"clock_source", facts.clock_source},
            {"load_1min", facts.load_1min}}}};
}

}  // namespace abs_hil::diagnosis
