#include <fmt/format.h>

#include <cstdio>
#include <iostream>
#include <string>

#include "abs_hil/driver/factory.hpp"
#include "abs_hil/experiment/commissioning.hpp"
#include "commands.hpp"
#include "exit_status.hpp"
#include "signals.hpp"

namespace abs_hil::app {

namespace {

/// Questions on stdout, answers from stdin.
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

}  // namespace

int commission(const RunRequest& request, const experiment::CommissioningOptions& options) {
  const driver::DriverOptions& driver_options = request.settings.driver;
  const auto driver = driver::make_rig_driver(driver_options);
  runtime::MonotonicClock clock;
  Terminal terminal;
  note_signals();
  terminal.tell(
      "Commissioning, in four steps, each asked for first. docs/rig-setup.md says what must be done before.\n"
      "The E-stop cuts the drive only, not the brake. If this program dies, the PWMs are assumed to hold.");
  experiment::Commissioning commissioning(*driver, clock, terminal, options,
                                          [] { return signalled() != rig::Reason::none; });
  switch (commissioning.run()) {
    case experiment::CommissioningResult::passed:
      terminal.tell(driver_options.emulated
                        ? "All four steps passed, on an emulator: that says nothing about hardware."
                        : "All four steps passed. Go on with docs/rig-setup.md, \"What is not verified\", and then set "
                          "driver.verified_on_hardware=true in your configuration.");
      return exit_completed;
    case experiment::CommissioningResult::declined:
      terminal.tell("Stopped as you wished; the outputs are safe.");
      return exit_ended_early;
    case experiment::CommissioningResult::failed: return exit_ended_early;
    case experiment::CommissioningResult::interrupted:
      return signalled() == rig::Reason::interrupt_signal ? exit_interrupted
             : signalled() == rig::Reason::hangup_signal  ? exit_hung_up
                                                          : exit_terminated;
  }
  return exit_ended_early;
}

}  // namespace abs_hil::app
