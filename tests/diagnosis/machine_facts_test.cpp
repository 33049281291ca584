// Facts about a computer's real-time fitness, from made-up /proc and /sys.
#include "diagnosis/machine_facts.hpp"

#include <algorithm>

#include "catch.hpp"
#include "fake_system.hpp"

using namespace abs_hil::diagnosis;
using namespace abs_hil::diagnosis::test;

namespace {
const Finding& finding(const std::vector<Finding>& findings, std::string_view what) {
  const auto found = std::find_if(findings.begin(), findings.end(),
                                  [&](const Finding& f) { return f.what.find(what) != std::string::npos; });
  REQUIRE(found != findings.end());
  return *found;
}
}  // namespace

TEST_CASE("the preemption model is read from what each kind of kernel shows") {
  const auto model = [](FakeSystem& system) { return read_machine_facts(system.root()).preemption; };
  FakeSystem realtime, dynamic, dynamic_hidden, full, none, silent;
  realtime.put("sys/kernel/realtime", "1");
  CHECK(model(realtime) == "PREEMPT_RT");
  dynamic.put("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1")
      .put("sys/kernel/debug/sched/preempt", "none voluntary (full)");
  CHECK(model(dynamic) == "full");
  dynamic_hidden.put("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1");
  CHECK(model(dynamic_hidden) == "dynamic, mode unknown");
  full.put("proc/sys/kernel/version", "#1 SMP PREEMPT Debian");
  CHECK(model(full) == "full");
  none.put("proc/sys/kernel/version", "#1 SMP Debian");
  CHECK(model(none) == "none or voluntary");
  CHECK(model(silent) == "unknown");
}

TEST_CASE("a well prepared computer has nothing to mend") {
  FakeSystem system;
  system.put("proc/sys/kernel/osrelease", "6.1.0-rt")
      .put("sys/kernel/realtime", "1")
      .put("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc")
      .put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance")
      .put("sys/devices/system/cpu/isolated", "3")
      .put("sys/devices/system/cpu/online", "0-3")
      .put("proc/cpuinfo", "model name\t: Some CPU\nflags\t\t: fpu tsc")
      .put("proc/loadavg", "0.25 0.10 0.05 1/100 200");
  const MachineFacts facts = read_machine_facts(system.root());
  CHECK(facts.kernel == "6.1.0-rt");
  CHECK(facts.cpu_model == "Some CPU");
  CHECK_FALSE(facts.virtual_machine);
  CHECK(facts.load_1min == 0.25);
  const auto findings = judge(facts);
  CHECK(worst(findings) <= Standing::note);
  CHECK(finding(findings, "isolated CPUs: 3").detail == "of 0-3");
}

TEST_CASE("each shortcoming of a computer is a warning with its fix, never a failure") {
  FakeSystem system;
  system.put("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC")
      .put("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet")
      .put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance")
      .put("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave")
      .put("proc/cpuinfo", "flags\t\t: fpu tsc hypervisor");
  const auto findings = judge(read_machine_facts(system.root()));
  CHECK(worst(findings) == Standing::warning);
  CHECK(finding(findings, "kernel").fix.find("linux-image-rt-amd64") != std::string::npos);
  CHECK(finding(findings, "clock source hpet").fix.find("current_clocksource") != std::string::npos);
  CHECK(finding(findings, "governor performance, powersave").fix.find("scaling_governor") != std::string::npos);
  CHECK(finding(findings, "virtual machine").standing == Standing::note);
}
