#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/finding.hpp"

namespace abs_hil::diagnosis {

/// Facts about a computer that affect its timing. "unknown" if the kernel does not report one.
struct MachineFacts {
  std::string kernel{};         ///< release
  std::string preemption{};     ///< "PREEMPT_RT", "full", "voluntary", "none", "dynamic, mode unknown"
  std::string clock_source{};   ///< as "tsc"
  std::string governor{};       ///< CPU frequency governor(s); "none": frequencies are not scaled
  std::string isolated_cpus{};  ///< as in isolcpus=; "none"
  std::string online_cpus{};
  std::string cpu_model{};
  bool virtual_machine{false};
  double load_1min{0.0};
};

/// @param root  folder that contains proc/ and sys/; other than "/" in tests
[[nodiscard]] MachineFacts read_machine_facts(const std::filesystem::path& root = "/");

/// The facts as findings of the checks "kernel", "clock" and "cpu". None of them prevents a run.
[[nodiscard]] std::vector<Finding> judge(const MachineFacts& facts);

}  // namespace abs_hil::diagnosis
