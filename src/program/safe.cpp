#include "program/safe.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "driver/factory.hpp"
#include "guardian/kept_board.hpp"
#include "guardian/service_call.hpp"
#include "program/board_owners.hpp"
#include "program/exit_status.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

namespace {

constexpr std::string_view board_keys = "driver.";
constexpr std::string_view socket_key = "guardian.socket";

bool is_wanted(std::string_view key) { return key.starts_with(board_keys) || key == socket_key; }

/// One board to make safe.
struct Target {
  std::string what{};
  std::vector<std::string> files{};
  driver::DriverOptions options{};
  std::string known_as{};  ///< the board's names for the resident service, one a line
};

/// The options of `driver.` and the resident service's socket alone: a mistake elsewhere in a configuration must not
/// keep a board from its safe state.
config::Settings board_settings(const RunOptions& o, const std::vector<std::string>& selection = {}) {
  config::Settings settings;
  config::KeyTable keys(settings);
  if (o.config_file) {
    for (const config::FileValue& value : config::read_file(*o.config_file)) {
      if (is_wanted(value.name)) keys.set(value.name, value.value, value.origin);
    }
  }
  for (const std::string& assignment : o.assignments) {
    if (is_wanted(assignment.substr(0, assignment.find('=')))) keys.set_text(assignment, "--set");
  }
  for (const std::string& assignment : selection) keys.set_text(assignment, "the board found");
  return settings;
}

driver::DriverOptions driver_options(const RunOptions& o, const std::vector<std::string>& selection = {}) {
  return board_settings(o, selection).driver;
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
    const driver::DriverOptions of_this = driver_options(o, of_board);
    // The service may have been given the board's address, or none.
    targets.push_back({.what = board.what,
                       .files = board.files,
                       .options = of_this,
                       .known_as = guardian::kept_board(of_this) + '\n' + guardian::kept_board(options)});
  }
}

std::vector<Target> find_targets(const RunOptions& o) {
  std::vector<Target> targets;
  if (names_board(o)) {
    const driver::DriverOptions options = driver_options(o);
    const driver::Backend& backend = driver::chosen_backend(options).entry;
    if (!backend.find) {
      return {{.what = "board of driver.kind=" + options.kind,
               .options = options,
               .known_as = guardian::kept_board(options)}};
    }
    add_targets(targets, o, backend);
    return targets;
  }
  for (const driver::Backend& backend : driver::registered_backends()) {
    if (backend.find) add_targets(targets, o, backend);
  }
  return targets;
}

/// Repeats `attempt` until it succeeds, at most for `insist_s`.
template <typename Attempt>
void insist(double insist_s, Attempt attempt) {
  runtime::MonotonicClock clock;
  const std::int64_t give_up_ns = clock.now_ns() + static_cast<std::int64_t>(insist_s * rig::ns_per_s);
  while (!attempt() && clock.now_ns() < give_up_ns) {
    constexpr std::int64_t pause_ns = 10'000'000;
    clock.sleep_until(clock.now_ns() + pause_ns);
  }
}

/// Writes zeros until they are verified. Returns the last problem, empty if there is none.
std::string write_zeros(const Target& target, double insist_s) {
  const driver::ChosenBackend chosen = driver::chosen_backend(target.options);
  driver::RunFacts facts = target.options.facts();
  facts.beside_guardian = true;
  try {
    const auto writer = chosen.entry.make_safe_state_writer(chosen.options, facts);
    writer->prepare();
    driver::IoResult result;
    insist(insist_s, [&] { return (result = writer->make_safe()).ok(); });
    return result.ok() ? std::string() : driver::error_text(result);
  } catch (const driver::Unavailable& error) {
    return error.what();
  }
}

/// The same through the resident service, which keeps the board and lets nobody else write.
std::string let_service_write(const std::string& socket, const Target& target, double insist_s) {
  std::optional<guardian::ServiceAnswer> said;
  insist(insist_s, [&] {
    said = guardian::service_makes_safe(socket, target.known_as);
    return !said || said->safe;
  });
  if (!said) return "the resident service has ended meanwhile; repeat the command";
  return said->safe ? std::string() : said->text;
}

std::string words_of(const BoardOwner& owner) { return fmt::format("process {} ({})", owner.pid, owner.name); }

/// Says what to pull; true if the board is safe.
bool make_target_safe(const Target& target, const std::string& socket, double insist_s) {
  std::string notes;
  const auto service = guardian::service_makes_safe(socket, target.known_as);
  const bool through_service = service && service->keeps_it;
  if (through_service) {
    notes += fmt::format(", by the resident service (process {}, {}); {}", service->service, socket, service->text);
  } else if (service && service->service == 0) {
    notes += fmt::format("; the resident service at {} cannot be asked: {}", socket, service->text);
  }
  bool alone = true;
  for (const BoardOwner& owner : owners_of(target.files)) {
    const bool ended = end_owner(owner);
    alone = alone && ended;
    notes += ended ? "; ended " + words_of(owner) : "; " + words_of(owner) + " drives it and could not be ended";
  }
  std::string problem = through_service ? let_service_write(socket, target, insist_s) : write_zeros(target, insist_s);
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
                      .help = "set a value of driver., or guardian.socket (abs_hil list --keys)",
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
  const std::string socket = board_settings(command.options).guardian.socket;
  const std::vector<Target> targets = find_targets(command.options);
  if (targets.empty()) {
    throw driver::Unavailable(
        "safe: no board found (abs_hil doctor --only boards); name it with --set driver.kind=KIND and its keys. A CAN "
        "node cannot be found: name it with --set driver.kind=can --set driver.can.interface=NAME (docs/can.md). If a "
        "wheel turns or the brake holds: press the E-stop (it cuts the drive only), then pull the rig's power plug");
  }
  bool all_safe = true;
  for (const Target& target : targets) all_safe = make_target_safe(target, socket, command.insist_s) && all_safe;
  return all_safe ? exit_completed : exit_ended_early;
}

}  // namespace abs_hil::program
