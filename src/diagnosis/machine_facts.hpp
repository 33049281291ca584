#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "diagnosis/doctor.hpp"
#include "rig/timing_summary.hpp"

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

/// The measurements of `abs_hil latency`.
struct LatencyRun {
  double rate_Hz{0.0};
  double duration_s{0.0};
  std::uint64_t cycles{0};
  bool realtime{false};
  rig::TimingSummary timing{};
  std::optional<driver::RigDriver::AnswerTimes> wire{};  ///< of a board that answers over a network
};

/// Grades of a computer's timing.
enum class Grade : std::uint8_t { very_good, good, usable, unfit };

/// A grade and the figures behind it.
struct Verdict {
  Grade jitter{Grade::unfit};    ///< worst wake-up: LinuxCNC's < 20 us very nice, 20-50 good, > 500 unacceptable
  double in_time{0.0};           ///< share of the ticks that were met, in [0, 1]: libfranka warns below 0.95
  double left_for_control{0.0};  ///< share of the period left after worst wake-up and p99.9 of the cycle;
                                 ///< ros2_control's users ask for 0.8
  Grade overall{Grade::unfit};   ///< the worst of the three
};
[[nodiscard]] Verdict judge(const LatencyRun& run) noexcept;

/// The measurements, the verdict and the computer's facts as text.
[[nodiscard]] std::string to_text(const LatencyRun& run, const MachineFacts& facts);
/// The same as JSON.
[[nodiscard]] nlohmann::ordered_json to_json(const LatencyRun& run, const MachineFacts& facts);

}  // namespace abs_hil::diagnosis
