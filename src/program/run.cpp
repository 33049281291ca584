#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <future>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "analysis/run_metrics.hpp"
#include "analysis/run_summary.hpp"
#include "config/plan.hpp"
#include "control/silent_settings.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "experiment/run_session.hpp"
#include "files/result_file.hpp"
#include "guardian/kept_board.hpp"
#include "program/board_notes.hpp"
#include "program/exit_status.hpp"
#include "program/foreign_run.hpp"
#include "program/questions.hpp"
#include "program/run_monitor.hpp"
#include "program/run_outputs.hpp"
#include "program/run_parts.hpp"
#include "program/run_results.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "runtime/board_policy.hpp"
#include "runtime/overrun_reporter.hpp"

namespace abs_hil::program {

namespace {

run_folder::RunEnvironment environment(const RunRequest& request, const driver::RigDriver& driver,
                                       const experiment::RunOutcome& outcome) {
  const config::Settings& s = request.settings;
  return {.command_line = request.command_line,
          .backend = s.backend,
          .board = std::string(driver.name()),
          .board_notes = driver.notes(),
          .emulated = s.backend == "rig" && s.driver.emulated,
          .virtual_time = request.outputs.fast,
          .realtime = outcome.realtime.realtime(),
          .realtime_shortcomings = request.outputs.fast ? std::string() : outcome.realtime.shortcomings()};
}

/// Logs messages about the timing of a run in real time.
class TimingMessages {
 public:
  TimingMessages(const RunRequest& request, const experiment::RunSession& session, runtime::OverrunReporter& reporter)
      : session_(session),
        reporter_(reporter),
        real_time_wanted_(!request.outputs.fast && request.settings.realtime.mode != runtime::RealtimeMode::off) {}

  void poll() {
    if (std::exchange(real_time_wanted_, false)) {
      const runtime::RealtimeReport& report = session_.realtime_report();
      const std::string shortcomings = report.shortcomings();
      if (!report.realtime()) {
        spdlog::warn("NOT IN REAL TIME: expect late cycles and wrong brake torques\n{}", shortcomings);
      } else if (!shortcomings.empty()) {
        spdlog::info("in real time, but some optional settings failed\n{}", shortcomings);
      }
    }
    if (const auto late = reporter_.message(session_.executive().statistics().overruns())) spdlog::warn("{}", *late);
  }

 private:
  const experiment::RunSession& session_;
  runtime::OverrunReporter& reporter_;
  bool real_time_wanted_;
};

}  // namespace

int status_of(const experiment::RunOutcome& outcome) {
  if (outcome.completed()) return exit_completed;
  if (outcome.reason == rig::Reason::interrupt_signal) return exit_interrupted;
  if (outcome.reason == rig::Reason::terminate_signal) return exit_terminated;
  if (outcome.reason == rig::Reason::hangup_signal) return exit_hung_up;
  return exit_ended_early;
}

std::string realtime_refusal(const runtime::RealtimeReport& report) {
  return "--rt require (the default on a real board): real-time scheduling is unavailable on this computer; nothing "
         "has "
         "moved. Mend the following; --rt prefer runs without it\n" +
         report.shortcomings();
}

namespace {

/// Without a limit of its own, the cycle's longest gap is that at which the guardian would act.
runtime::OverrunOptions overruns_of(const RunRequest& request) {
  runtime::OverrunOptions overruns = request.settings.realtime.overruns;
  if (overruns.cycle_gap_max_s == 0.0 && guardian::needs_guardian(request.settings, request.outputs.fast)) {
    constexpr double s_per_ms = 1e-3;
    overruns.cycle_gap_max_s = request.settings.guardian.timeout_ms * s_per_ms;
  }
  return overruns;
}

/// Checks in advance, as far as possible, that a guardian can start.
void require_own_guardian(const RunRequest& request) {
  static_cast<void>(guardian::safe_state_writer_of(request.settings.driver));
  const std::string program = guardian::guardian_program();
  if (::access(program.c_str(), X_OK) == 0) return;
  throw driver::Unavailable(
      "guardian: " + program + ": " + std::strerror(errno) +
      ": abs_hil needs its guardian to drive a rig; install abs_guardian in the folder of abs_hil");
}

/// Checks the required resources before the run's files are opened, so that a failure leaves an earlier run's files
/// unchanged. Throws driver::Unavailable. The run itself obtains the resources again.
void require_resources(const RunRequest& request, driver::RigDriver& driver, bool has_lease) {
  driver.configure();
  const config::Settings& s = request.settings;
  if (s.on_rig() && runtime::is_real_board(s.driver)) {
    const std::string note = experiment::require_record(s.driver, s.rig, driver.identity());
    if (!note.empty()) spdlog::warn("{}", note);
  }
  if (guardian::needs_guardian(s, request.outputs.fast) && !has_lease) require_own_guardian(request);
  if (request.outputs.fast || request.settings.realtime.mode != runtime::RealtimeMode::require) return;
  runtime::RealtimeReport report;
  // Uses a thread of its own: its scheduling class disappears with it.
  std::jthread([&] { report = runtime::RealtimeScope(request.settings.realtime).report(); }).join();
  if (!report.realtime()) throw driver::Unavailable(realtime_refusal(report));
}

/// Concludes the run: writes its files, reports how it ended, ends the guardian. Returns the exit status.
/// @param lost  why recorded data was lost; empty: nothing was lost
int conclude(const RunRequest& request, const experiment::RunSession& session, const experiment::RunOutcome& outcome,
             std::unique_ptr<driver::RigDriver> driver, RunOutputs& outputs, RunMonitor& run_monitor,
             const std::string& lost, const ForeignRun& foreign) {
  if (!outcome.safe_state.ok()) {
    spdlog::error("the safe state may not have reached the board ({}): {}. Press the E-stop and switch the rig off",
                  driver::error_text(outcome.safe_state), driver->what_holds_unsafe());
  }
  const analysis::RunSummary summary = summarise(request, session, outcome,
                                                 {.metrics = outputs.metrics(),
                                                  .friction_curve = outputs.friction_curve_json(),
                                                  .publish_failures = outputs.publish_failures(),
                                                  .csv_rows_lost = outputs.csv_rows_lost(),
                                                  .names = outputs.names(),
                                                  .foreign_controller = foreign.summary()});
  if (rig::is_fault(outcome.reason)) {
    run_monitor.write_record(request, outcome.reason, outcome.reason_value, summary.reason);
  }
  const std::vector<std::string> unwritten =
      outputs.write(summary, session.executive().statistics(), environment(request, *driver, outcome));
  if (!request.in_series) {
    std::string text = analysis::to_text(summary);
    if (const auto& folder = outputs.folder()) {
      text += fmt::format("  {:<22}{}\n", "run folder", folder->path().string());
    }
    // If the terminal was closed, the exit status must still be the run's.
    static_cast<void>(std::fputs(text.c_str(), stdout));
  }
  for (const std::string& line : driver->tally()) spdlog::info("{}", line);
  // Lets go of the board: the guard reads it back before it believes that the run is over.
  driver.reset();
  if (!outcome.completed()) spdlog::error("run ended early: {}", summary.reason);
  run_monitor.end();
  for (const std::string& problem : unwritten) spdlog::error("{}", problem);
  if (!lost.empty()) spdlog::error("recorded data was lost: {}", lost);
  if (!lost.empty() || !unwritten.empty()) return exit_ended_early;
  return status_of(outcome);
}

/// In a thread of its own, where a call of _exit() is caught.
experiment::RunOutcome run_fast(experiment::RunSession& session, const experiment::RunSession::Poll& poll) {
  std::packaged_task<experiment::RunOutcome()> task([&] { return session.run_fast(poll, true); });
  std::future<experiment::RunOutcome> outcome = task.get_future();
  std::jthread(std::move(task)).join();
  return outcome.get();
}

}  // namespace

int run(const RunRequest& request) {
  const config::Settings& s = request.settings;
  check_questions(request);
  runtime::MonotonicClock real_clock;
  runtime::VirtualClock virtual_clock;
  runtime::Clock& clock = request.outputs.fast ? static_cast<runtime::Clock&>(virtual_clock) : real_clock;
  // Outlives the driver: the service takes the board back when nobody has it open any more.
  const std::unique_ptr<guardian::GuardianLease> lease = guardian::ask_for_lease(s, request.outputs.fast);
  std::unique_ptr<driver::RigDriver> driver = with_faults(make_driver(s, request.outputs.fast), s, clock);
  config::Plan plan = config::plan(*request.script, s);
  for (const std::string& problem : config::beyond_limits(plan, s))
    spdlog::warn("{}; the gate limits it to that", problem);
  const bool to_stop = config::means_to_stop(plan, s.experiment.end_speed_m_s);
  ForeignRun foreign(request);
  experiment::RunLogicParts logic = make_logic(s, std::move(plan.phases), plan.limits);
  for (const std::string& problem : control::silent_settings(s.control)) spdlog::warn("{}", problem);
  require_resources(request, *driver, lease != nullptr);
  foreign.look_at(logic);
  RunOutputs outputs(request, logic.names);
  runtime::OverrunReporter late_cycles(std::llround(1e9 / s.control.rate_Hz));
  std::vector<rig::RecordSink*> sinks = outputs.sinks();
  if (!request.outputs.fast) sinks.push_back(&late_cycles);
  experiment::RunSession session(clock, *driver, std::move(logic), s.gate, std::move(sinks), overruns_of(request));
  TimingMessages timing(request, session, late_cycles);
  // Beside a board the guardian ends a run whose cycle stands still.
  if (s.backend == "sim" || request.outputs.fast) session.watch_for_slow_cycles();
  Questions questions(request, outputs.names());
  outputs.attach(session);
  const auto& folder = outputs.folder();
  RunMonitor run_monitor(request, lease.get(),
                         flight_record_prefix(request, folder ? folder->path() : std::filesystem::path()),
                         outputs.names());
  run_monitor.attach(session);
  note_signals();
  // The signal handler knows one run. In a series in virtual time, with several runs at once, each run polls instead.
  std::optional<SignalsStop> signals;
  if (!request.in_series || !request.outputs.fast) {
    signals.emplace(session, s.backend == "sim" || run_monitor.has_guardian());
  }
  BoardNotes board_notes(s, *driver);

  const auto poll = [&] {
    board_notes.log_once();
    timing.poll();
    outputs.poll();
    questions.poll(session);
    if (request.in_series) request.in_series(std::string(outputs.names().phase_of(session.latest())));
    if (const rig::Reason guardian = run_monitor.poll(); guardian != rig::Reason::none) return guardian;
    if (const rig::Reason signal = signalled(); signal != rig::Reason::none) return signal;
    return outputs.stop_requested() ? rig::Reason::stop_command : rig::Reason::none;
  };
  experiment::RunOutcome outcome;
  std::string lost;
  try {
    outcome = request.outputs.fast ? run_fast(session, poll) : session.run_realtime(s.realtime, poll);
  } catch (const files::FileError& error) {
    // The run itself completed: report it, and that its record is incomplete.
    lost = error.what();
    outcome = session.outcome();
  }
  if (!outcome.ran) {
    throw driver::Unavailable(realtime_refusal(outcome.realtime));
  }
  if (outcome.completed() && to_stop && outputs.moves_on()) {
    outcome.reason = rig::Reason::braking_without_stop;
    outcome.reason_value = outputs.metrics().final_speed_m_s;
  }
  if (signals) signals->allow_leaving();
  board_notes.log_once();
  if (request.stop_was_sent && outputs.stop_requested()) request.stop_was_sent();
  return conclude(request, session, outcome, std::move(driver), outputs, run_monitor, lost, foreign);
}

}  // namespace abs_hil::program
