// `abs_hil commission`: the first steps with a rig, as questions in the terminal.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <optional>
#include <string>

#include "config/config_file.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "experiment/commissioning.hpp"
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
  /// @param lease  null: a guardian of its own for each pulse
  GuardedPulse(const config::Configuration& configuration, driver::RigDriver& driver, guardian::GuardianLease* lease)
      : configuration_(configuration), driver_(driver), lease_(lease) {}
  ~GuardedPulse() override {
    driver_.tell_before_making_safe(nullptr);
    if (guardian_ != nullptr) static_cast<void>(guardian_->end());  // it uses this object's memory
  }

  void begin() override {
    if (!guardian::needs_guardian(configuration_.settings, false)) return;
    recorder_.emplace(1);
    const std::string launch_config = guardian_launch_json(configuration_, {});
    if (lease_ != nullptr) {
      lease_->cover(*recorder_, launch_config);
      guardian_ = lease_;
    } else {
      own_guardian_.emplace(*recorder_, guardian::guardian_program(), launch_config);
      guardian_ = &*own_guardian_;
    }
    watch_.emplace(guardian_->pages().run(), guardian_->pages().guard(), recorder_->ring());
    // The pulses run in this thread.
    guardian_->arm(runtime::scheduling_of_this_thread());
    driver_.tell_before_making_safe(&*guardian_);
  }
  [[nodiscard]] bool beat() noexcept override {
    if (guardian_ == nullptr || !watch_) return true;
    const runtime::GuardianSign guardian = watch_->beat();
    return guardian_->alive() && guardian.reason == rig::Reason::none;
  }
  void end(bool safe) noexcept override {
    if (guardian_ == nullptr) return;
    driver_.tell_before_making_safe(nullptr);
    guardian_->outputs_released(safe);
    static_cast<void>(guardian_->end(guardian::Stage::resting));
    guardian_ = nullptr;
    own_guardian_.reset();
  }

 private:
  const config::Configuration& configuration_;
  driver::RigDriver& driver_;
  guardian::GuardianLease* lease_;
  // The guardian must be destroyed before the recorder that it uses.
  std::optional<guardian::SharedRecorder> recorder_{};
  std::optional<guardian::Heartbeat> watch_{};
  std::optional<guardian::GuardianProcess> own_guardian_{};
  guardian::Guard* guardian_{nullptr};
};

/// The record without which nothing else drives this board. That of an emulator is kept only where somebody asks for
/// it.
void keep_record(const config::Settings& settings, const driver::BoardIdentity& board,
                 const experiment::Commissioning& measured, Terminal& terminal) {
  const driver::DriverOptions& options = settings.driver;
  const bool emulated = !runtime::is_real_board(options);
  if (emulated && options.records.empty()) return;
  experiment::BoardRecord record = experiment::describe_board(options, settings.rig, board, emulated);
  record.outputs = measured.output_times();
  record.one_turn = measured.one_turn();
  record.date = fmt::format("{:%Y-%m-%d %H:%M:%S %z}", fmt::localtime(std::time(nullptr)));
  record.version = ABS_HIL_VERSION;
  const auto file = experiment::write_record(record, experiment::record_folders(options.records));
  terminal.tell("commissioning record: " + file.string());
}

int commission(const config::Configuration& configuration, const experiment::CommissioningOptions& options) {
  const driver::DriverOptions& driver_options = configuration.settings.driver;
  const auto lease = guardian::ask_for_lease(configuration.settings, false);
  const auto driver = driver::make_rig_driver(driver_options);
  runtime::MonotonicClock clock;
  Terminal terminal;
  note_signals();
  terminal.tell(
      "Commissioning in steps; the program asks before each. First do what docs/rig-setup.md requires.\n"
      "The E-stop cuts the drive only, not the brake. A guardian stands by during each pulse (docs/dead-man.md).");
  terminal.tell(config::model_origin(configuration.settings,
                                     std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now())));
  terminal.tell(fmt::format(
      "identity {}: the limits of gate and checks come from it, and the record will hold it; --set rig.identity=FILE "
      "names the file of your rig (docs/safety.md)",
      configuration.settings.rig.source));
  GuardedPulse guard(configuration, *driver, lease.get());
  experiment::CommissioningOptions pulses = options;
  pulses.emulated = !runtime::is_real_board(driver_options);
  pulses.encoder_counts_per_rev = driver_options.encoder_counts_per_rev;
  experiment::Commissioning commissioning(*driver, clock, terminal, guard, pulses,
                                          [] { return signalled() != rig::Reason::none; });
  switch (commissioning.run()) {
    case experiment::CommissioningResult::passed:
      keep_record(configuration.settings, driver->identity(), commissioning, terminal);
      terminal.tell(driver_options.emulated
                        ? "All steps passed on an emulator. This does not verify any hardware."
                        : "All steps passed. Continue with docs/rig-setup.md, \"What is not verified\", and then set "
                          "driver.verified_on_hardware=true in your configuration.");
      return exit_completed;
    case experiment::CommissioningResult::declined:
      terminal.tell("Stopped at your request; the outputs are safe.");
      return exit_ended_early;
    case experiment::CommissioningResult::failed: return exit_ended_early;
    case experiment::CommissioningResult::interrupted: return status_of(signalled());
  }
  return exit_ended_early;
}

struct CommissionOptions {
  config::Sources sources{.backend = "rig"};
  experiment::CommissioningOptions pulses{};
};

}  // namespace

Action add_commission(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<CommissionOptions>();
  add_configuration_options(parser, o->sources);
  parser.add({.names = "--drive-duty",
              .to = &o->pulses.drive_duty,
              .help = "duty of the drive pulse, in (0, 0.3]",
              .show_default = true});
  parser.add({.names = "--brake-duty",
              .to = &o->pulses.brake_duty,
              .help = "duty of the brake pulse, in (0, 0.7]",
              .show_default = true});
  return [o] { return commission(config::merge(o->sources), o->pulses); };
}

}  // namespace abs_hil::program
