// `abs_hil commission`: the first steps with a rig, as questions in the terminal.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "config/board_policy.hpp"
#include "config/config_file.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "experiment/commissioning.hpp"
#include "program/run_monitor.hpp"
#include "program/subcommands.hpp"
#include "version/build_facts.hpp"

namespace abs_hil::program {

namespace {

/// Asks questions on stdout and reads answers from stdin.
class Terminal final : public experiment::Dialog {
 public:
  void tell(const std::string& text) override {
    cli::print("{}\n", text);
    std::fflush(stdout);
  }
  experiment::Answer ask(const std::string& question) override {
    tell("\n" + question + " [y/N]");
    const auto answer = line([] { return true; });
    if (!answer) return experiment::Answer::none;
    return *answer == "y" || *answer == "Y" || *answer == "yes" ? experiment::Answer::yes : experiment::Answer::no;
  }
  bool wait_until_done(const std::string& text, const std::function<bool()>& watch) override {
    tell(text);
    return line(watch).has_value();
  }

 private:
  /// The next line of stdin; nothing at its end, at a signal and if `watch` returns false.
  std::optional<std::string> line(const std::function<bool()>& watch) {
    constexpr int watch_ms = 50;
    std::array<char, 256> bytes{};
    for (;;) {
      if (const std::size_t end = typed_.find('\n'); end != std::string::npos) {
        std::string first = typed_.substr(0, end);
        typed_.erase(0, end + 1);
        return first;
      }
      pollfd readable{STDIN_FILENO, POLLIN, 0};
      const int ready = ::poll(&readable, 1, watch_ms);
      if (signalled() != rig::Reason::none || (ready == 0 && !watch())) return std::nullopt;
      if (ready <= 0) continue;
      const ssize_t got = ::read(STDIN_FILENO, bytes.data(), bytes.size());
      if (got <= 0) return typed_.empty() ? std::nullopt : std::optional(std::exchange(typed_, {}));
      typed_.append(bytes.data(), static_cast<std::size_t>(got));
    }
  }

  std::string typed_{};  ///< and not taken yet
};

/// A guardian for each pulse. Between pulses the outputs are 0 and the program waits for a person, without heartbeats.
class GuardedPulse final : public experiment::PulseGuard {
 public:
  /// @param lease  stays null where each pulse has a guardian of its own; ends after the driver has let go of the board
  GuardedPulse(const config::Configuration& configuration, driver::RigDriver& driver,
               std::unique_ptr<guardian::GuardianLease>& lease)
      : configuration_(configuration), driver_(driver), lease_(lease) {}
  ~GuardedPulse() override {
    driver_.tell_before_making_safe(nullptr);
    if (guardian_ != nullptr) static_cast<void>(guardian_->end());  // it uses this object's memory
  }

  /// The resident service ends a holder that is not covered in time, and a person takes longer than that.
  void take_board() override {
    lease_ = guardian::ask_for_lease(configuration_.settings, false);
    if (lease_ == nullptr) return;
    begin();
    end(true);
  }
  void begin() override {
    if (!guardian::needs_guardian(configuration_.settings, false)) return;
    recorder_.emplace(1);
    guardian_ = &started_guardian(lease_.get(), own_guardian_, *recorder_, guardian_launch_json(configuration_, {}));
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
  std::unique_ptr<guardian::GuardianLease>& lease_;
  // The guardian must be destroyed before the recorder that it uses.
  std::optional<guardian::SharedRecorder> recorder_{};
  std::optional<runtime::Heartbeat> watch_{};
  std::optional<guardian::GuardianProcess> own_guardian_{};
  guardian::Guard* guardian_{nullptr};
};

/// The record without which nothing else drives this board. That of an emulator is kept only where somebody asks for
/// it.
void keep_record(const config::Settings& settings, const driver::BoardIdentity& board,
                 const experiment::Commissioning& measured, Terminal& terminal) {
  const driver::DriverOptions& options = settings.driver;
  const bool emulated = !config::is_real_board(options);
  if (emulated && options.records.empty()) return;
  experiment::BoardRecord record = experiment::describe_board(options, settings.rig, board, emulated);
  record.outputs = measured.output_times();
  record.one_turn = measured.one_turn();
  record.date = fmt::format("{:%Y-%m-%d %H:%M:%S %z}", fmt::localtime(std::time(nullptr)));
  record.version = version::build_facts().version;
  const auto file = experiment::write_record(record, experiment::record_folders(options.records));
  terminal.tell("commissioning record: " + file.string());
}

experiment::CommissioningResult go_through(const config::Configuration& configuration,
                                           const experiment::CommissioningOptions& options, Terminal& terminal) {
  const driver::DriverOptions& driver_options = configuration.settings.driver;
  std::unique_ptr<guardian::GuardianLease> lease;
  const auto driver = driver::make_rig_driver(driver_options);
  runtime::MonotonicClock clock;
  terminal.tell(
      "Commissioning in steps; the program asks before each. First do what docs/rig-setup.md requires.\n"
      "Any answer but y makes it write zeros and end.\n"
      "The E-stop cuts the drive only, not the brake. A guardian stands by during each pulse (docs/dead-man.md).");
  terminal.tell(config::model_origin(configuration.settings,
                                     std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now())));
  terminal.tell(fmt::format(
      "identity {}: the limits of gate and checks come from it, and the record will hold it; --set rig.identity=FILE "
      "names the file of your rig (docs/safety.md)",
      configuration.settings.rig.source));
  GuardedPulse guard(configuration, *driver, lease);
  experiment::CommissioningOptions pulses = options;
  pulses.emulated = !config::is_real_board(driver_options);
  pulses.encoder_counts_per_rev = driver_options.encoder_counts_per_rev;
  experiment::Commissioning commissioning(*driver, clock, terminal, guard, pulses,
                                          [] { return signalled() != rig::Reason::none; });
  const experiment::CommissioningResult result = commissioning.run();
  if (result == experiment::CommissioningResult::passed) {
    keep_record(configuration.settings, driver->identity(), commissioning, terminal);
  }
  return result;
}

/// Makes the board safe that nobody has open here, and has perhaps never been opened. The resident service, if there is
/// one, does so before it grants a lease; no lease, no right to write.
/// @return why the safe state is not verified; empty if it is
std::string make_safe(const config::Settings& settings) try {
  if (guardian::ask_for_lease(settings, false) != nullptr) return {};
  const auto writer = driver::make_safe_state_writer(settings.driver);
  constexpr int tries = 20;
  constexpr int pause_ms = 10;
  driver::IoResult result{};
  for (int attempt = 0; attempt < tries; ++attempt) {
    result = writer->make_safe();
    if (result.ok()) return {};
    static_cast<void>(::poll(nullptr, 0, pause_ms));
  }
  // Says why the board cannot be opened.
  if (result.reason == rig::Reason::none) driver::make_safe_state_writer(settings.driver)->prepare();
  return experiment::reason_and_error(result);
} catch (const driver::Unavailable& error) {
  return error.what();
}

int commission(const config::Configuration& configuration, const experiment::CommissioningOptions& options) {
  Terminal terminal;
  note_signals();
  {  // Nobody is asked about a board that is not there. This reads only.
    const auto lease = guardian::ask_for_lease(configuration.settings, false);
    driver::make_rig_driver(configuration.settings.driver)->configure();
  }
  const experiment::CommissioningResult result = go_through(configuration, options, terminal);
  if (result == experiment::CommissioningResult::passed) {
    terminal.tell(configuration.settings.driver.emulated
                      ? "All steps passed on an emulator. This does not verify any hardware."
                      : "All steps passed. Continue with docs/rig-setup.md, \"What is not verified\", and then set "
                        "driver.verified_on_hardware=true in your configuration.");
    return exit_completed;
  }
  const std::string stopped =
      result == experiment::CommissioningResult::declined ? "Stopped at your request; " : "Stopped; ";
  const std::string unsafe = make_safe(configuration.settings);
  terminal.tell(stopped + (unsafe.empty() ? "the outputs are safe: zeros were written and read back."
                                          : "SAFE STATE NOT VERIFIED: " + unsafe +
                                                "\nPress the E-stop (it cuts the drive only), then pull the rig's "
                                                "power plug: the board may hold its last duties"));
  return result == experiment::CommissioningResult::interrupted ? status_of(signalled()) : exit_ended_early;
}

struct CommissionOptions {
  config::Sources sources{.backend = "rig"};
  experiment::CommissioningOptions pulses{};
};

}  // namespace

Action add_commission(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<CommissionOptions>();
  add_configuration_options(parser, o->sources);
  parser.add("--drive-duty", &o->pulses.drive_duty, "duty of the drive pulse, in (0, 0.3]", {.show_default = true});
  parser.add("--brake-duty", &o->pulses.brake_duty, "duty of the brake pulse, in (0, 0.7]", {.show_default = true});
  return [o] { return commission(config::merge(o->sources), o->pulses); };
}

}  // namespace abs_hil::program
