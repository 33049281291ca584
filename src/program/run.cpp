// `abs_hil`: one run with its guardian, files, network and messages, from the request to the exit status.
#include "run/run.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>

#include "analysis/run_summary.hpp"
#include "config/board_policy.hpp"
#include "config/config_error.hpp"
#include "config/plan.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "files/result_file.hpp"
#include "guardian/guardian_lease.hpp"
#include "program/extra.hpp"
#include "program/run_monitor.hpp"
#include "program/run_outputs.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "runtime/record_pump.hpp"

namespace abs_hil::program {

namespace {

run_folder::RunEnvironment environment(const std::vector<std::string>& command_line, run::Run& run,
                                       const run::RunOutcome& outcome) {
  const config::Settings& s = run.settings();
  return {.command_line = command_line,
          .backend = s.backend,
          .board = std::string(run.driver().name()),
          .board_notes = run.driver().notes(),
          .emulated = s.on_rig() && s.driver.emulated,
          .virtual_time = !run.real_time(),
          .realtime = outcome.realtime.realtime(),
          .realtime_shortcomings = run.real_time() ? outcome.realtime.shortcomings() : std::string()};
}

/// What the driver reports about its board, and that it is not verified on hardware. For a driver that is configured.
void log_board_notes(const config::Settings& s, const driver::RigDriver& driver) {
  if (!s.on_rig()) return;
  for (const std::string& note : driver.notes()) spdlog::info("{}", note);
  if (const std::string note = driver::verification_note(s.driver); !note.empty()) spdlog::warn("{}", note);
}

/// Puts the questions of a run's phases to the terminal and hands Enter to the run. For the slow thread.
class Questions {
 public:
  /// @param run  must outlive it
  Questions(const RunRequest& request, run::Run& run)
      : run_(run),
        by_person_(request.settings.experiment.answers == experiment::answers_person),
        commands_(hears_commands(request)) {
    if (by_person_ || !config::asks(*request.script) || request.in_series) return;
    spdlog::info("the simulation answers the questions of experiment {} itself, at once", request.script->name);
  }

  /// Call it every few milliseconds. Never waits.
  void poll() {
    if (!by_person_) return;
    const rig::CycleRecord& latest = run_.latest();
    const std::string_view question = run_.names().question_of(latest);
    if (question.empty()) {
      asked_ = -1;
    } else if (asked_ != latest.phase_index) {
      asked_ = latest.phase_index;
      // Enter pressed before the question was asked is no answer to it.
      if (terminal_) static_cast<void>(::tcflush(STDIN_FILENO, TCIFLUSH));
      cli::print(stderr, "\n{}{}\n", question, commands_ ? " (or: abs_hil send continue)" : "");
      std::fflush(stderr);
    } else if (terminal_ && entered()) {
      static_cast<void>(run_.adjustments().put({.kind = experiment::Adjustment::Kind::answer}));
    }
  }

 private:
  [[nodiscard]] bool entered() {
    pollfd ready{STDIN_FILENO, POLLIN, 0};
    if (::poll(&ready, 1, 0) <= 0 || (ready.revents & POLLIN) == 0) return false;
    std::array<char, 256> line{};
    const ssize_t size = ::read(STDIN_FILENO, line.data(), line.size());
    terminal_ = size > 0;  // otherwise it was closed
    return terminal_ && std::find(line.begin(), line.begin() + size, '\n') != line.begin() + size;
  }

  run::Run& run_;
  bool by_person_;
  bool commands_;
  bool terminal_{at_terminal()};
  int asked_{-1};  ///< index of the phase whose question stands; -1: none
};

/// Logs messages about the timing of a run in real time.
class TimingMessages {
 public:
  explicit TimingMessages(run::Run& run)
      : run_(run),
        late_cycles_(run.prepared().period_ns),
        set_up_untold_(run.real_time() && run.settings().realtime.mode != runtime::RealtimeMode::off) {
    if (run.real_time()) run.record_into({&late_cycles_});
  }

  void poll() {
    if (std::exchange(set_up_untold_, false)) {
      const runtime::RealtimeReport& report = run_.realtime_report();
      const std::string shortcomings = report.shortcomings();
      if (!report.realtime()) {
        spdlog::warn("NOT IN REAL TIME: expect late cycles and wrong brake torques\n{}", shortcomings);
      } else if (!shortcomings.empty()) {
        spdlog::info("in real time, but some optional settings failed\n{}", shortcomings);
      }
    }
    if (const auto late = late_cycles_.message(run_.executive().statistics().overruns())) spdlog::warn("{}", *late);
  }

 private:
  const run::Run& run_;
  runtime::OverrunReporter late_cycles_;
  bool set_up_untold_;
};

/// Checks in advance, as far as possible, that a guardian can start.
void require_own_guardian(const driver::DriverOptions& board) {
  static_cast<void>(driver::make_safe_state_writer(board));
  const std::string program = guardian::guardian_program();
  if (::access(program.c_str(), X_OK) == 0) return;
  throw driver::Unavailable("guardian: abs_hil needs its guardian to drive a rig: " + program + ": " +
                            rig::refusal(errno, program, rig::starting));
}

/// The extras' parts in this run. Throws config::ConfigError if it needs an extra that this build lacks.
std::vector<std::unique_ptr<RunPart>> run_parts(const RunRequest& request) {
  if (request.settings.commands.enabled &&
      std::ranges::find(extras(), std::string_view("commands"), &Extra::name) == extras().end()) {
    throw config::ConfigError(
        "commands.enabled = true, but this abs_hil was built without the extra \"commands\"; leave the key out, or "
        "build "
        "with -DABS_HIL_COMMANDS=ON");
  }
  std::vector<std::unique_ptr<RunPart>> parts;
  for (const Extra* extra : extras()) {
    if (extra->join != nullptr) parts.push_back(extra->join(request));
  }
  return parts;
}

/// Writes the run's files, reports how it ended, ends the guardian. Returns the exit status.
/// @param lost  why recorded data was lost; empty: nothing was lost
int conclude(const RunRequest& request, run::Run& run, const run::RunOutcome& outcome, RunOutputs& outputs,
             RunMonitor& run_monitor, const std::string& lost) {
  if (!outcome.safe_state.ok()) {
    spdlog::error("the safe state may not have reached the board ({}): {}. Press the E-stop and switch the rig off",
                  driver::error_text(outcome.safe_state), run.driver().what_holds_unsafe());
  }
  analysis::RunSummary summary = run::summarise(run, outcome, outputs.controller_facts());
  summary.config = nlohmann::ordered_json::parse(request.json);
  summary.publish_failures = outputs.publish_failures();
  summary.csv_rows_lost = outputs.csv_rows_lost();
  if (rig::is_fault(outcome.reason)) {
    std::string account = summary.reason;
    for (const std::string& line : run.driver().traffic()) account += '\n' + line;
    run_monitor.write_record(request, outcome.reason, outcome.reason_value, account);
  }
  const std::vector<std::string> unwritten =
      outputs.write(summary, environment(request.command_line, run, outcome), lost.empty());
  if (!request.in_series) {
    std::string text = analysis::to_text(summary);
    if (const auto& folder = outputs.folder()) {
      text += fmt::format("  {:<22}{}\n", "run folder", folder->path().string());
    }
    // If the terminal was closed, the exit status must still be the run's.
    static_cast<void>(std::fputs(text.c_str(), files::for_people()));
  }
  for (const std::string& line : run.driver().tally()) spdlog::info("{}", line);
  // The guard reads the board back before it believes that the run is over.
  run.release_driver();
  if (!outcome.completed()) spdlog::error("run ended early: {}", summary.reason);
  run_monitor.end();
  for (const std::string& problem : unwritten) spdlog::error("{}", problem);
  if (!lost.empty()) spdlog::error("recorded data was lost: {}", lost);
  if (!lost.empty() || !unwritten.empty()) return exit_ended_early;
  return status_of(outcome);
}

}  // namespace

int status_of(const run::RunOutcome& outcome) {
  if (outcome.completed()) return exit_completed;
  return is_signal(outcome.reason) ? status_of(outcome.reason) : exit_ended_early;
}

std::string realtime_refusal(const runtime::RealtimeReport& report) {
  return "--rt require (the default on a real board): real-time scheduling is unavailable on this computer; nothing "
         "has moved. Mend the following; --rt prefer runs without it\n" +
         report.shortcomings();
}

runtime::OverrunOptions overruns_of(const config::Settings& s, bool virtual_time) {
  runtime::OverrunOptions overruns = s.realtime.overruns;
  if (overruns.cycle_gap_max_s == 0.0 && guardian::needs_guardian(s, virtual_time)) {
    constexpr double s_per_ms = 1e-3;
    overruns.cycle_gap_max_s = s.guardian.timeout_ms * s_per_ms;
  }
  return overruns;
}

void require_resources(run::Run& run, bool has_lease) {
  run.driver().configure();
  const config::Settings& s = run.settings();
  if (s.on_rig() && !config::is_real_board(s.driver)) {
    spdlog::info("an emulator: no commissioning record is asked for; weak limits and foreign code are accepted");
  } else if (s.on_rig()) {
    experiment::require_record(s.driver, s.rig, run.driver().identity());
  }
  if (guardian::needs_guardian(s, !run.real_time()) && !has_lease) require_own_guardian(s.driver);
  if (!run.real_time() || s.realtime.mode != runtime::RealtimeMode::require) return;
  runtime::RealtimeReport report;
  // Uses a thread of its own: its scheduling class disappears with it.
  std::jthread([&] { report = runtime::RealtimeScope(s.realtime).report(); }).join();
  if (!report.realtime()) throw driver::Unavailable(realtime_refusal(report));
}

int run(const RunRequest& request) {
  const config::Settings& s = request.settings;
  const bool virtual_time = request.virtual_time;
  check_questions(request);
  // Outlives the driver: the service takes the board back when nobody has it open any more.
  const std::unique_ptr<guardian::GuardianLease> lease = guardian::ask_for_lease(s, virtual_time);
  const run::Prepared prepared(s, *request.script);
  for (const std::string& problem : config::beyond_limits(prepared.plan, s))
    spdlog::warn("{}; the gate limits it to that", problem);
  for (const std::string& problem : config::certain_faults(prepared.plan, s)) spdlog::warn("{}", problem);
  std::vector<std::unique_ptr<RunPart>> parts = run_parts(request);
  run::Run run(prepared, {.real_time = !virtual_time, .overruns = overruns_of(s, virtual_time)});
  require_resources(run, lease != nullptr);
  for (const auto& part : parts) part->attach(run);
  RunOutputs outputs(request, run, std::move(parts));
  TimingMessages timing(run);
  // Beside a board the guardian ends a run whose cycle stands still.
  if (!s.on_rig() || virtual_time) run.watch_for_slow_cycles();
  Questions questions(request, run);
  const auto& folder = outputs.folder();
  RunMonitor run_monitor(request, lease.get(),
                         flight_record_prefix(request, folder ? folder->path() : std::filesystem::path()), run.names());
  run_monitor.attach(run);
  note_signals();
  // The signal handler knows one run. In a series in virtual time, with several runs at once, each run polls instead.
  std::optional<SignalsStop> signals;
  if (!request.in_series || !virtual_time) signals.emplace(run, !s.on_rig() || run_monitor.has_guardian());

  bool board_told = false;
  const auto poll = [&] {
    if (!std::exchange(board_told, true)) log_board_notes(s, run.driver());
    timing.poll();
    outputs.poll();
    questions.poll();
    if (request.in_series) request.in_series(std::string(run.names().phase_of(run.latest())));
    if (const rig::Reason guardian = run_monitor.poll(); guardian != rig::Reason::none) return guardian;
    if (const rig::Reason signal = signalled(); signal != rig::Reason::none) return signal;
    return outputs.stop_requested() ? rig::Reason::stop_command : rig::Reason::none;
  };
  run::RunOutcome outcome;
  std::string lost;
  try {
    outcome = run.go_guarded(poll);
  } catch (const files::FileError& error) {
    // The run itself completed: report it, and that its record is incomplete.
    lost = error.what();
    outcome = run.outcome();
  }
  if (!outcome.ran) throw driver::Unavailable(realtime_refusal(outcome.realtime));
  if (signals) signals->allow_leaving();
  if (request.stop_was_sent && outputs.stop_requested()) request.stop_was_sent();
  return conclude(request, run, outcome, outputs, run_monitor, lost);
}

}  // namespace abs_hil::program
