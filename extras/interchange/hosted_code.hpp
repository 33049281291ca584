#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "driver/file_descriptor.hpp"
#include "interchange/confinement.hpp"
#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Foreign code in a process of its own (`host_program`): what it breaks, it breaks there. The process is confined
/// (confinement.hpp), so nothing of the code outlives this object. Every call has a limit of time, and so have all
/// calls together: 10 s and a hundred times the time that the run simulates. What the code prints goes to stderr, up to
/// a limit. A step costs two changes of process (about 20 us). Not for boards: `step` waits for the other process.
class HostedCode final : public ForeignCode {
 public:
  /// Starts the process and makes the controller there. Throws std::invalid_argument, which names the file, if the code
  /// refuses or dies.
  explicit HostedCode(const ForeignSetup& setup);
  HostedCode(const HostedCode&) = delete;
  HostedCode& operator=(const HostedCode&) = delete;
  /// Ends the process.
  ~HostedCode() override { end(); }

  void reset(const abs_hil_input& input) noexcept override;
  void step(const abs_hil_input& input, abs_hil_output& output) noexcept override;
  [[nodiscard]] std::string failure() const override { return failure_; }

  [[nodiscard]] StepTimes warm_up_there(double period_s, std::uint32_t steps);
  /// Ends the process as well.
  [[nodiscard]] Offences probe(double period_s, std::uint32_t steps);

 private:
  explicit HostedCode(double period_s) : period_s_(period_s) {}

  void start(const std::string& program);
  /// Waits for a packet and passes on what the code prints. Bytes of the packet; 0: the other end is closed; < 0: none
  /// came in time.
  [[nodiscard]] ssize_t receive(void* data, std::size_t size, int limit_ms) noexcept;
  void pass_on_prints() noexcept;
  [[nodiscard]] bool too_many_threads() const noexcept;
  [[nodiscard]] bool ask(const HostRequest& request, HostAnswer& answer) noexcept;
  void end() noexcept;
  /// Ends the process. Says how it ended by itself, or what was wrong with its answer.
  /// @param got  what `receive` returned for `answer`
  [[nodiscard]] std::string how_it_ended(ssize_t got, const void* answer) noexcept;

  pid_t pid_{0};
  driver::FileDescriptor socket_{};
  driver::FileDescriptor prints_{};  ///< pipe with what the code prints
  std::size_t printed_{0};
  double period_s_;
  std::uint64_t steps_{0};      ///< since the last reset
  std::uint64_t all_steps_{0};  ///< of the run
  std::int64_t spent_ns_{0};    ///< waiting for them
  std::string failure_{};
};

/// For a process that is not abs_hil itself, as Python: the path of abs_hil, beside which the host's program is looked
/// for. Call it before any controller is made.
void set_host_beside(const std::string& program);

}  // namespace abs_hil::interchange
