#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/reason.hpp"
#include "cli/command_line.hpp"
#include "config/merge.hpp"
#include "files/result_file.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

/// The files of a run's records, and its network.
struct OutputOptions {
  std::optional<std::string> csv_file{};
  std::optional<std::string> log_file{};
  std::optional<std::string> summary_file{};
  std::optional<std::string> histogram_file{};
  std::optional<std::string> recorder_dir{};  ///< --recorder: folder of the flight record, written after a fault
  std::optional<std::string> prior_file{};    ///< --prior, renewed after a stop
  std::optional<std::string> lcm_url{};
  bool no_lcm{false};
  std::optional<std::string> run_folder{};  ///< --out: a new or empty folder
  bool no_run_folder{false};                ///< --no-out

  /// True if an option names a file for the run's records.
  [[nodiscard]] bool names_files() const { return csv_file || log_file || summary_file || histogram_file; }
};

/// The options of `abs_hil` as typed, before they are merged with files.
struct RunOptions : config::Sources {
  OutputOptions outputs{};
};

/// A completely specified run: its effective configuration and the files of its records.
struct RunRequest : config::Configuration {
  OutputOptions outputs{};
  bool virtual_time{false};                 ///< --fast
  std::vector<std::string> command_line{};  ///< as typed; recorded in environment.json
  /// Set for one run of a series: the run prints only faults, and calls this now and then with its current phase.
  std::function<void(std::string_view phase)> in_series{};
  /// Called after a run of a series if somebody sent it a stop, even one that came too late for that run.
  std::function<void()> stop_was_sent{};
};

/// True if the run takes commands over LCM.
[[nodiscard]] bool hears_commands(const RunRequest& request);
/// True if stdin is a terminal.
[[nodiscard]] bool at_terminal() noexcept;
/// Refuses a run whose questions nobody could answer, or that would move a rig without a person's answer. Throws
/// config::ConfigError.
void check_questions(const RunRequest& request);

/// Opens a result before anything moves, so that a bad path is reported at once; null without a path. Throws
/// config::ConfigError. @param kind  for messages, as "histogram"
[[nodiscard]] std::unique_ptr<files::ResultFile> open_result(const std::optional<std::string>& path,
                                                             const std::string& kind);

/// No result of this process may replace a file that these name.
void keep_inputs(const config::Sources& sources);

/// The options as a run. A person answers its questions on a rig or at a terminal. Throws config::ConfigError.
[[nodiscard]] RunRequest merge(const RunOptions& options);

/// Exit statuses of the program (docs/experiments.md).
enum ExitStatus : int {
  exit_completed = 0,
  exit_ended_early = 1,    ///< a fault, a limit, a stop command, or recorded data lost
  exit_usage = 2,          ///< usage or configuration; nothing has moved
  exit_unavailable = 3,    ///< the backend or a required resource is unavailable
  exit_hung_up = 129,      ///< SIGHUP, after the safe stop
  exit_interrupted = 130,  ///< SIGINT, after the safe stop
  exit_terminated = 143,   ///< SIGTERM, after the safe stop
};

/// A command line as typed.
using Words = std::vector<std::string>;
/// What a subcommand does after the command line is read. Returns the exit status. Throws what program.cpp catches.
using Action = std::function<int()>;

/// One row of the table of subcommands (subcommands.cpp, and those of the extras). `abs_hil --help`, the shell's
/// completion and the search for the nearest name are made from it.
struct Subcommand {
  std::string_view name;
  std::string_view help;
  /// Adds the options to the subcommand's parser. Null: `abs_hil NAME` starts abs_NAME, a program in Python.
  Action (*add)(cli::Parser& parser, const Words& words){nullptr};
};
[[nodiscard]] const std::vector<Subcommand>& subcommands();

/// If the first argument names a program in Python, it takes this process over with the other arguments. Returns the
/// exit status if that fails, after a message that says what to install; nothing for any other first argument.
[[nodiscard]] std::optional<int> start_python_program(int argc, char** argv);
/// abs_NAME beside this program; elsewhere it is for the PATH to find.
[[nodiscard]] std::string python_program(std::string_view name);
/// Why it could not be started, and what to install. @param error  an errno
[[nodiscard]] std::string no_python_program(std::string_view name, int error);

Action add_list(cli::Parser& parser, const Words& words);
Action add_doctor(cli::Parser& parser, const Words& words);
Action add_latency(cli::Parser& parser, const Words& words);
Action add_validate(cli::Parser& parser, const Words& words);
Action add_commission(cli::Parser& parser, const Words& words);
Action add_init_rig(cli::Parser& parser, const Words& words);
Action add_safe(cli::Parser& parser, const Words& words);

/// Runs an experiment and returns the exit status. Throws what its parts throw: see program.cpp.
int run(const RunRequest& request);
/// Runs the series of runs that `base.script` describes; each run is merged anew from the options as typed. Returns the
/// exit status. Throws as `run`.
int run_series(const RunOptions& options, const RunRequest& base);

/// `abs_hil safe` for a command line that begins with `safe`, without the time that it takes to build the command lines
/// of all subcommands. Nothing for any other, for its help, and for a wrong one, after the boards have their zeros.
[[nodiscard]] std::optional<int> safe_at_once(int argc, char** argv);

/// The exit status for the outcome of a run.
[[nodiscard]] int status_of(const run::RunOutcome& outcome);
/// The message for a run that requires real time and did not start.
[[nodiscard]] std::string realtime_refusal(const runtime::RealtimeReport& report);
/// Without a limit of its own, the cycle's longest gap is that at which the guardian would act.
[[nodiscard]] runtime::OverrunOptions overruns_of(const config::Settings& s, bool virtual_time);
/// Configures the board and checks all else that a run needs, before the run's files are opened: a failure leaves an
/// earlier run's files unchanged. The run itself obtains the resources again. Throws driver::Unavailable.
void require_resources(run::Run& run, bool has_lease);

// The command line's options of a run, as rows. Subcommands take those that they understand.

/// --backend
void add_backend_option(cli::Parser& parser, config::Sources& o);
/// --config
void add_config_file(cli::Parser& parser, config::Sources& o);
/// --set
void add_assignments(cli::Parser& parser, config::Sources& o);
/// Those that belong to the configuration, not to a single run: --config, --plant, --model, --controller, --set.
void add_configuration_options(cli::Parser& parser, config::Sources& o);
/// --threads
void add_threads(cli::Parser& parser, std::size_t& threads);
/// --rate, --rt, --histogram
void add_timing_options(cli::Parser& parser, config::Sources& o, std::optional<std::string>& histogram_file);
/// All of a run's.
void add_run_options(cli::Parser& parser, RunOptions& o);

// Signals to the program, and its terminals.

/// Opens /dev/null on each of the descriptors 0, 1 and 2 that was closed at program start, so that no file of the run
/// gets that number and receives messages for people. Also ignores SIGPIPE.
void survive_closed_terminals();

/// From now on SIGINT, SIGTERM and SIGHUP are noted and do not end the program. Under nohup SIGHUP stays ignored.
/// @param may_leave  a second signal ends the program at once: there are no outputs
void note_signals(bool may_leave = false);
[[nodiscard]] constexpr bool is_signal(rig::Reason reason) noexcept {
  return reason == rig::Reason::interrupt_signal || reason == rig::Reason::terminate_signal ||
         reason == rig::Reason::hangup_signal;
}
/// Exit status of a program that a signal ended.
[[nodiscard]] int status_of(rig::Reason signal) noexcept;
/// The stop reason of a noted signal; `none` if there was none.
[[nodiscard]] rig::Reason signalled() noexcept;

/// While this object lives, a signal ends the run at its next cycle, directly from the handler: a slow thread
/// that hangs at a disk or network causes no delay. A second signal ends the program at once, if that is safe.
class SignalsStop {
 public:
  /// @param may_leave  true if a guardian protects the outputs, or if there are no real outputs
  SignalsStop(run::Run& run, bool may_leave) noexcept;
  SignalsStop(const SignalsStop&) = delete;
  SignalsStop& operator=(const SignalsStop&) = delete;
  ~SignalsStop();
  /// Call when the outputs are safe: a second signal may then end the program.
  void allow_leaving() noexcept;
};

}  // namespace abs_hil::program
