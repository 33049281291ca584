#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/finding.hpp"

namespace abs_hil::diagnosis {

/// What about a computer decides how well it keeps time. "unknown" where the kernel does not tell.
struct MachineFacts {
  std::string kernel{};         ///< release
  std::string preemption{};     ///< "PREEMPT_RT", "full", "voluntary", "none", "dynamic, mode unknown"
  std::string clock_source{};   ///< "tsc", say
  std::string governor{};       ///< CPU frequency governor(s); "none": frequencies are not scaled
  std::string isolated_cpus{};  ///< as in isolcpus=; "none"
  std::string online_cpus{};
  std::string cpu_model{};
  bool virtual_machine{false};
  double load_1min{0.0};
};

/// @param root where /proc and /sys are, for tests
[[nodiscard]] MachineFacts read_machine_facts(const std::filesystem::path& root = "/");

/// The facts as findings of the checks "kernel", "clock" and "cpu". None of them keeps a run from starting.
[[nodiscard]] std::vector<Finding> judge(const MachineFacts& facts);

}  // namespace abs_hil::diagnosis
