#include "program/safe.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "driver/factory.hpp"
#include "program/board_owners.hpp"
#include "program/exit_status.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

namespace {

constexpr std::string_view board_keys = "driver.";

/// One board to make safe.
struct Target {
  std::string what{};
  std::vector<std::string> files{};
  driver::DriverOptions options{};
};

/// The options of `driver.` alone: a mistake elsewhere in a configuration must not keep a board from its safe state.
driver::DriverOptions driver_options(const RunOptions& o, const std::vector<std::string>& selection = {}) {
  config::Settings settings;
  config::KeyTable keys(settings);
  if (o.config_file) {
    for (const config::FileValue& value : config::read_file(*o.config_file)) {
      if (value.name.starts_with(board_keys)) keys.set(value.name, value.value, value.origin);
    }
  }
  for (const std::string& assignment : o.assignments) {
    if (assignment.starts_with(board_keys)) keys.set_text(assignment, "--set");
  }
  for (const std::string& assignment : selection) keys.set_text(assignment, "the board found");
  return settings.driver;
}

bool names_board(const RunOptions& o) {
  if (o.config_file) return true;
  for (const std::string& assignment : o.assignments) {
    if (assignment.starts_with("driver.kind=")) return true;
  }
  return false;
}

void add_targets(std::vector<Target>& targets, const RunOptions& o, const driver::Backend& backend) {
  std::vector<std::string> selection{"driver.kind=" + std::string(backend.name)};
  const driver::DriverOptions options = driver_options(o, selection);
  for (const driver::FoundBoard& board : backend.find(driver::chosen_backend(options).options)) {
    std::vector<std::string> of_board = selection;
    of_board.insert(of_board.end(), board.selection.begin(), board.selection.end());
    targets.push_back({.what = board.what, .files = board.files, .options = driver_options(o, of_board)});
  }
}

std::vector<Target> find_targets(const RunOptions& o) {
  std::vector<Target> targets;
  if (names_board(o)) {
    const driver::DriverOptions options = driver_options(o);
    const driver::Backend& backend = driver::chosen_backend(options).entry;
    if (!backend.find) return {{.what = "board of driver.kind=" + options.kind, .options = options}};
    add_targets(targets, o, backend);
    return targets;
  }
  for (const driver::Backend& backend : driver::registered_backends()) {
    if (backend.find) add_targets(targets, o, backend);
  }
  return targets;
}

/// Writes zeros until they are verified. Returns the last error.
driver::IoResult insist(driver::SafeStateWriter& writer, double insist_s) {
  runtime::MonotonicClock clock;
  const std::int64_t give_up_ns = clock.now_ns() + static_cast<std::int64_t>(insist_s * rig::ns_per_s);
  for (;;) {
    const driver::IoResult result = writer.make_safe();
    if (result.ok() || clock.now_ns() >= give_up_ns) return result;
    constexpr std::int64_t pause_ns = 10'000'000;
    clock.sleep_until(clock.now_ns() + pause_ns);
  }
}

std::string words_of(const BoardOwner& owner) { return fmt::format("process {} ({})", owner.pid, owner.name); }

/// Says what to pull; true if the board is safe.
bool make_target_safe(const Target& target, double insist_s) {
  const driver::ChosenBackend chosen = driver::chosen_backend(target.options);
  driver::RunFacts facts = target.options.facts();
  facts.beside_guardian = true;
  std::string notes;
  bool alone = true;
  for (const BoardOwner& owner : owners_of(target.files)) {
    const bool ended = end_owner(owner);
    alone = alone && ended;
    notes += ended ? "; ended " + words_of(owner) : "; " + words_of(owner) + " drives it and could not be ended";
  }
  std::string problem;
  try {
    const auto writer = chosen.entry.make_safe_state_writer(chosen.options, facts);
    writer->prepare();
    if (const driver::IoResult result = insist(*writer, insist_s); !result.ok()) problem = driver::error_text(result);
  } catch (const driver::Unavailable& error) {
    problem = error.what();
  }
  if (problem.empty() && alone) {
    fmt::print("{}: drive 0 and brake 0, verified{}\n", target.what, notes);
    return true;
  }
  if (problem.empty()) problem = "the zeros were verified, but may be overwritten: run this as root";
  fmt::print(stderr,
             "abs_hil: {}: SAFE STATE NOT VERIFIED: {}{}\nPress the E-stop (it cuts the drive only), then pull the "
             "rig's power plug: the board may hold its last duties\n",
             target.what, problem, notes);
  return false;
}

}  // namespace

void add_safe(cli::Parser& parser, SafeCommand& command) {
  command.parser = parser.add_subcommand(
      "safe", "make the configured board, or every board found, safe and verify it; ends the run that drives it");
  command.parser.add({.names = "--config",
                      .to = &command.options.config_file,
                      .help = "TOML file whose table [driver] names the board",
                      .type = "FILE"});
  command.parser.add({.names = "--set",
                      .to = &command.options.assignments,
                      .help = "set a value of driver. (abs_hil list --keys)",
                      .type = "key=value",
                      .repeated = true});
  command.parser.add({.names = "--insist",
                      .to = &command.insist_s,
                      .help = "how long to try to verify the safe state, s",
                      .type = "S",
                      .range = {0.0, 3600.0},
                      .show_default = true});
}

int make_boards_safe(const SafeCommand& command) {
  const std::vector<Target> targets = find_targets(command.options);
  if (targets.empty()) {
    throw driver::Unavailable(
        "safe: no board found (abs_hil doctor --only boards); name it with --set driver.kind=KIND and its keys. If a "
        "wheel turns or the brake holds: press the E-stop (it cuts the drive only), then pull the rig's power plug");
  }
  bool all_safe = true;
  for (const Target& target : targets) all_safe = make_target_safe(target, command.insist_s) && all_safe;
  return all_safe ? exit_completed : exit_ended_early;
}

}  // namespace abs_hil::program
