#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

#include "interchange/foreign_code.hpp"
#include "interchange/host_protocol.hpp"

namespace abs_hil::interchange {

/// Foreign code in a process of its own, abs_controller_host: what it breaks, it breaks there. A step costs two changes
/// of process (about 20 us). Not for boards: `step` waits for the other process.
class HostedCode final : public ForeignCode {
 public:
  /// Starts the process and makes the controller there. Throws std::invalid_argument, which names the file, if the code
  /// refuses or dies.
  explicit HostedCode(const ForeignSetup& setup);
  HostedCode(const HostedCode&) = delete;
  HostedCode& operator=(const HostedCode&) = delete;
  /// Ends the process.
  ~HostedCode() override;

  void reset(const abs_hil_input& input) noexcept override;
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override;
  [[nodiscard]] std::string failure() const override { return failure_; }
  /// Duration of the last step within the other process.
  [[nodiscard]] std::int64_t step_ns() const noexcept { return step_ns_; }

  [[nodiscard]] StepTimes warm_up_there(double period_s, std::uint32_t steps);
  /// Ends the process as well.
  [[nodiscard]] Offences probe(double period_s, std::uint32_t steps);

 private:
  [[nodiscard]] bool ask(const HostRequest& request, HostAnswer& answer) noexcept;
  void end() noexcept;
  /// How the process ended, or that it does not answer.
  [[nodiscard]] std::string obituary(bool silent) noexcept;

  pid_t pid_{0};
  int socket_{-1};
  std::uint64_t steps_{0};
  std::int64_t step_ns_{0};
  std::string failure_{};
};

/// Path of the host's program: abs_controller_host beside the running program, otherwise the installed one.
[[nodiscard]] std::string host_program();

}  // namespace abs_hil::interchange
