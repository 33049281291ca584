// `abs_hil safe`: writes zeros to the configured board, or to every board found, before anything else.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <future>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/board_owners.hpp"
#include "guardian/guardian_lease.hpp"
#include "program/first_place.hpp"
#include "program/subcommands.hpp"
#include "program/zero_writing.hpp"

namespace abs_hil::program {

namespace {

using guardian::BoardOwner;
constexpr double most_insist_s = 3600.0;

/// Options of `abs_hil safe` as typed.
struct SafeCommand {
  config::Sources sources{.backend = "rig"};  ///< only the configuration file and the assignments are used
  double insist_s{3.0};                       ///< how long it tries to verify
};

// Bounds of everything that may hang, ms.
constexpr int file_read_within_ms = 20;    ///< then the boards that can be found without the file get their zeros
constexpr int late_file_within_ms = 2000;  ///< and from the file's end on those that it names
constexpr int first_tries_within_ms = 100;
constexpr int owners_found_within_ms = 2000;
constexpr int service_answers_within_ms = 500;
constexpr int written_out_within_ms = 2000;
constexpr int threads_end_within_ms = 200;

/// Does the work in a thread of its own, which goes on if it hangs.
template <typename Work>
auto in_background(Work work) {
  std::packaged_task<decltype(work())()> task(std::move(work));
  auto result = task.get_future();
  std::thread(std::move(task)).detach();
  return result;
}

template <typename Result>
bool is_there(const std::future<Result>& result, int most_ms) {
  return result.wait_for(std::chrono::milliseconds(most_ms)) == std::future_status::ready;
}

/// What the command line and its file say of boards. A wrong part is left out: it must not keep a board from its zeros.
struct Given {
  std::vector<std::string> assignments{};
  std::vector<config::FileValue> values{};  ///< of the file, `driver.` and the resident service's socket alone
  bool names_board{false};
  std::vector<std::string> problems{};
};

config::Settings settings_of(const Given& given, const std::vector<std::string>& selection = {},
                             std::vector<std::string>* problems = nullptr) {
  config::Settings settings;
  config::KeyTable keys(settings);
  const auto take = [problems](const auto& set) {
    try {
      set();
    } catch (const config::ConfigError& error) {
      if (problems != nullptr) problems->emplace_back(error.what());
    }
  };
  for (const config::FileValue& v : given.values) take([&] { keys.set(v.name, v.value, v.origin); });
  for (const std::string& a : given.assignments) take([&] { keys.set_text(a, "--set"); });
  for (const std::string& a : selection) take([&] { keys.set_text(a, "the board found"); });
  return settings;
}

/// @param file  is read; nothing: the command line alone counts
Given read_given(const config::Sources& o, const std::optional<std::string>& file) {
  Given given{.assignments = o.assignments, .names_board = file.has_value()};
  for (const std::string& a : o.assignments) given.names_board = given.names_board || a.starts_with("driver.kind=");
  try {
    for (config::FileValue& value : file ? config::read_file(*file) : std::vector<config::FileValue>{}) {
      if (value.name.starts_with("driver.") || value.name == "guardian.socket")
        given.values.push_back(std::move(value));
    }
  } catch (const std::exception& error) {
    given.names_board = false;
    given.problems.emplace_back(error.what());
  }
  const driver::DriverOptions board = settings_of(given, {}, &given.problems).driver;
  try {
    if (given.names_board) static_cast<void>(driver::make_safe_state_writer(board, true));
  } catch (const std::exception& error) {  // its place is no place: then all that can be found are searched
    given.names_board = false;
    given.problems.emplace_back(error.what());
  }
  return given;
}

/// The boards of one backend. One that cannot look for boards has one, if the options name it.
std::vector<Target> targets_of(const Given& given, const driver::Backend& backend, bool named) {
  const std::vector<std::string> selection{"driver.kind=" + std::string(backend.name)};
  const driver::DriverOptions options = settings_of(given, selection).driver;
  if (!backend.find) {
    if (!named) return {};
    return {{.what = "board of driver.kind=" + options.kind,
             .options = options,
             .known_as = guardian::kept_board(options)}};
  }
  std::vector<Target> targets;
  for (const driver::FoundBoard& board : backend.find(driver::chosen_backend(options).options)) {
    std::vector<std::string> of_board = selection;
    of_board.insert(of_board.end(), board.selection.begin(), board.selection.end());
    const driver::DriverOptions of_this = settings_of(given, of_board).driver;
    // The service may have been given the board's address, or none.
    targets.push_back({.what = board.what,
                       .files = board.files,
                       .options = of_this,
                       .known_as = guardian::kept_board(of_this) + '\n' + guardian::kept_board(options)});
  }
  return targets;
}

/// Looks for the board that is named, or for every board if none is or something is wrong with the names.
void search(ZeroWriting& zeros, const Given& given) {
  const std::string kind = settings_of(given).driver.kind;
  for (const driver::Backend& backend : driver::registered_backends()) {
    const bool named = given.names_board && backend.name == kind;
    if (!named && given.names_board && given.problems.empty()) continue;
    zeros.search([given, &backend, named] { return targets_of(given, backend, named); });
  }
}

std::vector<std::vector<std::string>> files_of(const std::vector<Seen>& boards) {
  std::vector<std::vector<std::string>> files;
  for (const Seen& board : boards) files.push_back(board.target.files);
  return files;
}

/// The owners of the boards; none if that takes too long.
std::optional<std::vector<BoardOwner>> find_owners(const ZeroWriting& zeros) {
  auto found = in_background([files = files_of(zeros.seen())] { return guardian::owners_of(files); });
  if (!is_there(found, owners_found_within_ms)) return std::nullopt;
  return found.get();
}

bool is_one_of(const std::vector<BoardOwner>& owners, const BoardOwner& owner) {
  return std::ranges::find(owners, owner.pid, &BoardOwner::pid) != owners.end();
}

/// Ends the owners of the boards until there are none but those that may not be ended. Zeros go on meanwhile.
std::vector<BoardOwner> end_all_owners(const ZeroWriting& zeros, std::vector<std::string>& problems) {
  constexpr std::int64_t reacts_within_ns = 50 * rig::ns_per_ms;
  constexpr int most_rounds = 5;  // something may start them again
  // One that keeps the board from its zeros, or drives on although it was asked to stop, must go at once.
  const auto must_go = [&zeros](std::size_t board, std::int64_t asked_ns) {
    const Seen seen = zeros.seen()[board];
    return !seen.reached || seen.on_ns > asked_ns + reacts_within_ns;
  };
  std::vector<BoardOwner> met;
  for (int round = 0; round < most_rounds; ++round) {
    auto owners = find_owners(zeros);
    if (!owners) {
      problems.emplace_back("looking for the processes that drive the boards took too long: /proc does not answer");
      break;
    }
    std::erase_if(*owners, [&met](const BoardOwner& owner) { return is_one_of(met, owner); });
    if (owners->empty()) break;
    guardian::end_owners(*owners, must_go);
    met.insert(met.end(), owners->begin(), owners->end());
  }
  return met;
}

/// Those that this user may not end: the resident service may have ended them meanwhile.
void look_again(const ZeroWriting& zeros, std::vector<BoardOwner>& owners) {
  if (std::ranges::all_of(owners, &BoardOwner::ended)) return;
  const auto still_there = find_owners(zeros);
  for (BoardOwner& owner : owners) owner.ended = owner.ended || (still_there && !is_one_of(*still_there, owner));
}

/// The resident service's word: a note, and the only way to a board that it alone can have open.
struct ServiceWord {
  std::optional<guardian::ServiceAnswer> answer{};
  [[nodiscard]] bool says_safe() const { return answer && answer->safe; }
  [[nodiscard]] std::string words(const std::string& socket) const {
    if (!answer) return {};
    if (answer->service == 0) {
      return fmt::format("; the resident service at {} cannot be asked: {}", socket, answer->text);
    }
    if (answer->answered && !answer->keeps_it) return {};  // another board's
    return fmt::format("; the resident service (process {}, {}): {}", answer->service, socket, answer->text);
  }
};

ServiceWord ask_service(const std::string& socket, const Target& target) {
  auto answer =
      in_background([socket, boards = target.known_as] { return guardian::service_makes_safe(socket, boards); });
  if (is_there(answer, service_answers_within_ms)) return {answer.get()};
  return {guardian::ServiceAnswer{.text = "no answer in time"}};
}

/// So many tries must have verified the zeros, unbroken, after the last owner's end: one that was stopped between its
/// two accesses to a card may undo a zero when it dies.
constexpr int enough_quiet_tries = 10;

bool is_verified(const Seen& seen, const ServiceWord& service) {
  return seen.quiet_tries >= enough_quiet_tries || (!seen.reached && service.says_safe());
}

/// Waits until each board's zeros are verified, at most `insist_s`.
void verify(ZeroWriting& zeros, const std::string& socket, std::vector<ServiceWord>& services, double insist_s) {
  constexpr double least_s = 0.1;  // for that many tries
  constexpr int pause_ms = 5;
  constexpr std::int64_t ask_again_ns = 100 * rig::ns_per_ms;
  const std::int64_t begin_ns = driver::monotonic_ns();
  const std::int64_t end_ns = begin_ns + static_cast<std::int64_t>(std::max(insist_s, least_s) * rig::ns_per_s);
  std::int64_t asked_ns = begin_ns;
  for (zeros.count_anew(); driver::monotonic_ns() < end_ns; static_cast<void>(::poll(nullptr, 0, pause_ms))) {
    const std::vector<Seen> seen = zeros.seen();
    bool all = true;
    const bool may_ask = driver::monotonic_ns() > asked_ns + ask_again_ns;
    for (std::size_t i = 0; i < services.size(); ++i) {
      all = all && is_verified(seen[i], services[i]);
      // It lets nobody else write, and may have had to end a lease first.
      if (may_ask && !seen[i].reached && services[i].answer) services[i] = ask_service(socket, seen[i].target);
    }
    if (may_ask) asked_ns = driver::monotonic_ns();
    if (all) return;
  }
}

/// The words about one board; says what to pull.
std::string words_about(const Seen& seen, const std::vector<BoardOwner>& owners, std::size_t board,
                        const ServiceWord& service, const std::string& socket, std::int64_t started_ns, bool& safe) {
  std::string notes;
  if (seen.zero_ns != 0) {
    notes += fmt::format("; zeros written first {:.1f} ms after the start",
                         static_cast<double>(seen.zero_ns - started_ns) / rig::ns_per_ms);
  }
  if (seen.before) {
    notes += fmt::format("; before: drive {:.2f}, brake {:.2f}", seen.before->motor_duty, seen.before->brake_duty);
  }
  bool alone = true;
  for (const BoardOwner& owner : owners) {
    if (owner.board != board) continue;
    alone = alone && owner.ended;
    const std::string name = fmt::format("process {} ({})", owner.pid, owner.name);
    notes += owner.ended ? "; ended " + name + (owner.killed ? " with SIGKILL" : "")
                         : "; " + name + " drives it and could not be ended";
  }
  notes += service.words(socket);
  const bool by_service = seen.quiet_tries < enough_quiet_tries;
  safe = alone && is_verified(seen, service);
  if (safe) {
    return fmt::format("{}: drive 0 and brake 0, verified{}{}\n", seen.target.what,
                       by_service ? " by the resident service alone" : "", notes);
  }
  std::string problem = seen.problem;
  if (problem.empty()) {
    problem = alone ? fmt::format(
                          "the zeros were verified, but not {} times in a row: the link to the board loses data, or "
                          "something else drives it",
                          enough_quiet_tries)
                    : "the zeros were verified, but another process may overwrite them";
    if (::geteuid() != 0) problem += "; run this as root";
  }
  return fmt::format(
      "abs_hil: {}: SAFE STATE NOT VERIFIED: {}{}\nPress the E-stop (it cuts the drive only), then pull the rig's "
      "power plug: the board may hold its last duties\n",
      seen.target.what, problem, notes);
}

/// Prints, at most for a moment: somebody may hold the other end of a full pipe.
bool print(std::string good, std::string bad) {
  auto printed = in_background([good = std::move(good), bad = std::move(bad)] {
    cli::print(stderr, "{}", bad);
    cli::print("{}", good);
    std::fflush(stdout);
  });
  return is_there(printed, written_out_within_ms);
}

/// Ends the runs that drive the boards, too, asks the resident service, verifies, and says what it saw and what to
/// pull. Zeros go out all the while. Nothing in it waits without a bound. Returns the exit status; if something hangs
/// it ends the process.
int make_boards_safe(const SafeCommand& command) {
  const std::int64_t started_ns = driver::monotonic_ns();
  take_first_place();
  ZeroWriting zeros;
  Given given;
  auto with_file = in_background([o = command.sources] { return read_given(o, o.config_file); });
  const bool in_time = is_there(with_file, file_read_within_ms);
  given = in_time ? with_file.get() : read_given(command.sources, std::nullopt);
  search(zeros, given);
  zeros.wait_for_first_tries(first_tries_within_ms);
  if (!in_time && is_there(with_file, late_file_within_ms)) {
    given = with_file.get();
    search(zeros, given);
    zeros.wait_for_first_tries(first_tries_within_ms);
  } else if (!in_time) {
    given.problems.push_back(command.sources.config_file.value_or("the command line") +
                             ": cannot be read: its file system does not answer");
  }

  std::vector<std::string> problems = given.problems;
  std::vector<BoardOwner> owners = end_all_owners(zeros, problems);
  const std::string socket = settings_of(given).guardian.socket;
  std::vector<ServiceWord> services;
  for (const Seen& seen : zeros.seen()) services.push_back(ask_service(socket, seen.target));
  verify(zeros, socket, services, command.insist_s);
  look_again(zeros, owners);

  const std::vector<Seen> boards = zeros.seen();
  for (std::string& problem : zeros.problems()) problems.push_back(std::move(problem));
  int status = !problems.empty() ? exit_usage : boards.empty() ? exit_unavailable : exit_completed;
  std::string good;
  std::string bad;
  for (std::size_t i = 0; i < services.size(); ++i) {
    bool safe = false;
    const std::string words = words_about(boards[i], owners, i, services[i], socket, started_ns, safe);
    (safe ? good : bad) += words;
    if (!safe) status = exit_ended_early;
  }
  for (const std::string& problem : problems) bad += "abs_hil: " + problem + '\n';
  if (boards.empty()) {
    bad +=
        "abs_hil: safe: no board found (abs_hil doctor --only boards); name it with --set driver.kind=KIND and its "
        "keys. A CAN node cannot be found: name it with --set driver.kind=can --set driver.can.interface=NAME "
        "(docs/can.md). If a wheel turns or the brake holds: press the E-stop (it cuts the drive only), then pull the "
        "rig's power plug\n";
  }
  const bool printed = print(std::move(good), std::move(bad));
  if (!zeros.end(threads_end_within_ms) || !printed) std::_Exit(status);
  return status;
}

}  // namespace

Action add_safe(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<SafeCommand>();
  parser.add("--config", &o->sources.config_file, "TOML file whose table [driver] names the board", {.type = "FILE"});
  parser.add("--set", &o->sources.assignments, "set a value of driver., or guardian.socket (abs_hil list --keys)",
             {.type = "key=value", .repeated = true});
  parser.add("--insist", &o->insist_s, "how long to try to verify the safe state, s",
             {.type = "S", .range = {0.0, most_insist_s}, .show_default = true});
  return [o] { return make_boards_safe(*o); };
}

std::optional<int> safe_at_once(int argc, char** argv) {
  SafeCommand command;
  if (argc < 2 || std::string_view(argv[1]) != "safe") return std::nullopt;
  bool understood = true;
  for (int i = 2; i < argc; ++i) {
    std::string_view name = argv[i];
    if (name == "--help" || name == "-h") return std::nullopt;
    std::optional<std::string> value;
    if (const std::size_t at = name.find('='); at != std::string_view::npos) {
      value = name.substr(at + 1);
      name = name.substr(0, at);
    } else if (i + 1 < argc) {
      value = argv[++i];
    }
    if (name == "--config" && value) {
      command.sources.config_file = *value;
    } else if (name == "--set" && value) {
      command.sources.assignments.push_back(*value);
    } else if (name == "--insist" && value) {
      char* rest = nullptr;
      command.insist_s = std::strtod(value->c_str(), &rest);
      understood = understood && *rest == 0 && command.insist_s >= 0.0 && command.insist_s <= most_insist_s;
    } else {
      understood = false;
    }
  }
  // A wrong command line is refused by those who have words for it, once the boards have their zeros.
  if (!understood) command.insist_s = 0.0;
  const int status = make_boards_safe(command);
  return understood ? std::optional(status) : std::nullopt;
}

}  // namespace abs_hil::program
