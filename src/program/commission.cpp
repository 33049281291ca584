#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <iostream>
#include <optional>
#include <string>

#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "experiment/commissioning.hpp"
#include "program/exit_status.hpp"
#include "program/run_monitor.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "runtime/board_policy.hpp"

namespace abs_hil::program {

namespace {

/// Asks questions on stdout and reads answers from stdin.
class Terminal final : public experiment::Dialog {
 public:
  void tell(const std::string& text) override {
    fmt::print("{}\n", text);
    std::fflush(stdout);
  }
  bool ask(const std::string& question) override {
    tell("\n" + question + " [y/N]");
    std::string answer;
    return std::getline(std::cin, answer) && (answer == "y" || answer == "Y" || answer == "yes");
  }
  bool wait_until_done(const std::string& text) override {
    tell(text);
    std::string line;
    return static_cast<bool>(std::getline(std::cin, line));
  }
};

/// A guardian for each pulse. Between pulses the outputs are 0 and the program waits for a person, without heartbeats.
class GuardedPulse final : public experiment::PulseGuard {
 public:
  GuardedPulse(const RunRequest& request, driver::RigDriver& driver) : request_(request), driver_(driver) {}
  ~GuardedPulse() override { driver_.tell_before_making_safe(nullptr); }

  void begin() override {
    if (!needs_guardian(request_)) return;
    region_.emplace(1);
    watch_.emplace(region_->panel(), region_->recorder());
    guardian_.emplace(*region_, guardian::guardian_program(), guardian_launch_json(request_, {}));
    guardian_->arm();
    driver_.tell_before_making_safe(&*guardian_);
  }
  [[nodiscard]] bool beat() noexcept override {
    if (!guardian_ || !watch_) return true;
    watch_->beat();
    return guardian_->alive();
  }
  void end(bool safe) noexcept override {
    if (!guardian_) return;
    driver_.tell_before_making_safe(nullptr);
    guardian_->outputs_released(safe);
    static_cast<void>(guardian_->end());
    guardian_.reset();
  }

 private:
  const RunRequest& request_;
  driver::RigDriver& driver_;
  // The guardian must be destroyed before the region that it uses.
  std::optional<guardian::SharedRegion> region_{};
  std::optional<runtime::Heartbeat> watch_{};
  std::optional<guardian::GuardianProcess> guardian_{};
};

/// The record without which nothing else drives this board. That of an emulator is kept only where somebody asks for
/// it.
void keep_record(const RunRequest& request, const driver::BoardIdentity& board, const experiment::OutputTimes& outputs,
                 Terminal& terminal) {
  const driver::DriverOptions& options = request.settings.driver;
  const bool emulated = !runtime::is_real_board(options);
  if (emulated && options.records.empty()) return;
  experiment::BoardRecord record = experiment::describe_board(options, board, emulated);
  record.outputs = outputs;
  record.date = fmt::format("{:%Y-%m-%d %H:%M:%S %z}", fmt::localtime(std::time(nullptr)));
  record.version = ABS_HIL_VERSION;
  const auto file = experiment::write_record(record, experiment::record_folders(options.records));
  terminal.tell("commissioning record: " + file.string());
}

}  // namespace

int commission(const RunRequest& request, const experiment::CommissioningOptions& options) {
  const driver::DriverOptions& driver_options = request.settings.driver;
  const auto driver = driver::make_rig_driver(driver_options);
  runtime::MonotonicClock clock;
  Terminal terminal;
  note_signals();
  terminal.tell(
      "Commissioning in four steps; the program asks before each. First do what docs/rig-setup.md requires.\n"
      "The E-stop cuts the drive only, not the brake. A guardian stands by during each pulse (docs/dead-man.md).");
  GuardedPulse guard(request, *driver);
  experiment::Commissioning commissioning(*driver, clock, terminal, guard, options,
                                          [] { return signalled() != rig::Reason::none; });
  switch (commissioning.run()) {
    case experiment::CommissioningResult::passed:
      keep_record(request, driver->identity(), commissioning.output_times(), terminal);
      terminal.tell(
          driver_options.emulated
              ? "All four steps passed on an emulator. This does not verify any hardware."
              : "All four steps passed. Continue with docs/rig-setup.md, \"What is not verified\", and then set "
                "driver.verified_on_hardware=true in your configuration.");
      return exit_completed;
    case experiment::CommissioningResult::declined:
      terminal.tell("Stopped at your request; the outputs are safe.");
      return exit_ended_early;
    case experiment::CommissioningResult::failed: return exit_ended_early;
    case experiment::CommissioningResult::interrupted:
      return signalled() == rig::Reason::interrupt_signal ? exit_interrupted
             : signalled() == rig::Reason::hangup_signal  ? exit_hung_up
                                                          : exit_terminated;
  }
  return exit_ended_early;
}

}  // namespace abs_hil::program
