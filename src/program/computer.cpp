// What this computer can do: `abs_hil doctor` checks it and the boards at it, and `abs_hil latency` runs the real-time
// cycle and judges its timing. On the simulated rig that accelerates and brakes. On a board it only reads and writes
// zeros, under the guard and the conditions of a run.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "config/board_policy.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "diagnosis/doctor.hpp"
#include "diagnosis/machine_facts.hpp"
#include "driver/factory.hpp"
#include "experiment/board_record.hpp"
#include "experiment/sequence.hpp"
#include "guardian/guardian_lease.hpp"
#include "program/run_monitor.hpp"
#include "program/subcommands.hpp"
#include "run/run.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::program {

namespace {

/// Who has the outputs, as the resident service says.
diagnosis::Finding service_finding(const std::string& socket) {
  diagnosis::Finding finding{
      .check = "boards", .what = "resident guardian at " + socket, .standing = diagnosis::Standing::note};
  const auto service = guardian::service_state(socket);
  if (!service) {
    finding.detail = "none listens: each run starts its own (docs/dead-man.md)";
  } else if (service->service == 0) {
    finding.standing = diagnosis::Standing::warning;
    finding.detail = "cannot be asked: " + service->text;
  } else {
    finding.detail = fmt::format("process {} keeps {}", service->service, service->text);
  }
  return finding;
}

/// Runs all checks of this computer or the named one, and prints a fix for each shortcoming.
int doctor(const config::Settings& s, const std::string& only, bool json) {
  std::unique_ptr<guardian::GuardianLease> lease;
  diagnosis::Examination examination{.only = only,
                                     .lcm_url = telemetry::default_lcm_url(),
                                     .realtime = s.realtime,
                                     .backend = s.backend,
                                     .rate_Hz = s.control.rate_Hz,
                                     .driver = s.driver,
                                     .make_driver = [&] {
                                       // The resident service lets go of the board for the holder of its lease.
                                       lease = guardian::ask_for_lease(s, false);
                                       return run::make_driver(s);
                                     }};
  if (s.on_rig() && config::is_real_board(s.driver)) {
    examination.require_commissioned = [&s](const driver::RigDriver& driver) {
      experiment::require_record(s.driver, s.rig, driver.identity());
    };
  }
  std::vector<diagnosis::Finding> findings = diagnosis::examine(examination);
  if (const std::string note = driver::verification_note(s.driver);
      !note.empty() && (only.empty() || only == "boards")) {
    findings.push_back({.check = "boards", .what = note, .standing = diagnosis::Standing::note});
  }
  if (only.empty() || only == "boards") findings.push_back(service_finding(s.guardian.socket));
  if (s.on_rig() && (only.empty() || only == "backend")) {
    const auto today = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
    findings.push_back(
        {.check = "backend", .what = config::model_origin(s, today), .standing = diagnosis::Standing::note});
  }
  const bool well = diagnosis::turned_out_well(examination, findings);
  if (json) {
    const nlohmann::ordered_json report{
        {"backend", s.backend}, {"well", well}, {"findings", diagnosis::to_json(findings)}};
    // Facts of the computer, as an environment variable, may hold any bytes.
    constexpr auto any_bytes = nlohmann::ordered_json::error_handler_t::replace;
    cli::print("{}\n", report.dump(2, ' ', false, any_bytes));
  } else {
    cli::print("{}", diagnosis::to_text(findings));
  }
  return well ? exit_completed : exit_unavailable;
}

struct DoctorOptions {
  config::Sources sources{};
  std::string only{};
  bool json{false};
};

struct LatencyOptions {
  config::Sources sources{};
  std::optional<std::string> histogram_file{};
  double duration_s{10.0};
  std::optional<int> second_offset_us{};  ///< offset of the first cycle from a whole second, us
  bool json{false};
};

constexpr double longest_load_s = 86'400.0;
constexpr double accelerate_s = 1.0;
constexpr double brake_s = 0.3;
/// Initial speed of both wheels. It keeps the wheels far from standstill: there the simulation takes so many small
/// steps that its cost would hide the computer's own latency.
constexpr double start_speed_rad_s = 50.0;

experiment::PhasePlan timed(rig::Phase phase, double duration_s) {
  constexpr double slack_s = 1.0;
  return {.phase = phase,
          .ends_on = {{experiment::EndKind::duration, duration_s, rig::Reason::phase_duration_over}},
          .time_limit_s = duration_s + slack_s};
}

/// Phases that load a cycle as an experiment does: they alternate acceleration and braking under slip control, last
/// `duration_s` in all, and end with the brake released. For the simulated rig only: no phase waits for a speed.
config::Plan timing_load(double duration_s) {
  config::Plan plan;
  for (double left_s = duration_s; left_s > 0.0;) {
    experiment::PhasePlan accelerate = timed(rig::Phase::accelerate, std::min(accelerate_s, left_s));
    accelerate.motor_duty = 1.0;
    plan.phases.push_back(accelerate);
    left_s -= accelerate_s;
    if (left_s <= 0.0) break;
    experiment::PhasePlan brake = timed(rig::Phase::brake, std::min(brake_s, left_s));
    brake.brake = experiment::BrakeAction::slip_control;
    plan.phases.push_back(brake);
    left_s -= brake_s;
  }
  return plan;
}

int latency(const LatencyOptions& options) {
  RunRequest request;
  static_cast<config::Configuration&>(request) = config::merge(options.sources);
  config::Settings& s = request.settings;
  constexpr double least_cycles = 10.0;
  if (options.duration_s * s.control.rate_Hz < least_cycles) {
    throw config::ConfigError(fmt::format("--duration {:g} s: give at least {:g} s, {:g} cycles at {:g} Hz",
                                          options.duration_s, least_cycles / s.control.rate_Hz, least_cycles,
                                          s.control.rate_Hz));
  }
  const bool on_rig = s.on_rig();
  if (!on_rig) s.experiment.start_speed_rad_s = start_speed_rad_s;
  // Gaps in the simulation are what this command measures; they must not end it.
  constexpr double any_gap_s = 3600.0;
  if (!on_rig) s.realtime.overruns.cycle_gap_max_s = any_gap_s;
  const auto histogram = open_result(options.histogram_file, "histogram");
  const std::unique_ptr<guardian::GuardianLease> lease = guardian::ask_for_lease(s, false);
  // A board is read and gets zeros. No wheel turns.
  const config::Plan idle{.phases = {timed(rig::Phase::idle, options.duration_s)}};
  const run::Prepared prepared(s, on_rig ? idle : timing_load(options.duration_s));
  run::Run run(prepared, {.real_time = true, .overruns = overruns_of(s, false)});
  if (on_rig) require_resources(run, lease != nullptr);
  std::optional<RunMonitor> monitor;
  if (on_rig) monitor.emplace(request, lease.get(), std::filesystem::path(), run.names()).attach(run);
  if (options.second_offset_us) run.align_to_second(std::int64_t{*options.second_offset_us} * 1000);
  note_signals();
  const diagnosis::MachineFacts facts = diagnosis::read_machine_facts();
  const auto poll = [&] {
    const rig::Reason guard = monitor ? monitor->poll() : rig::Reason::none;
    return guard != rig::Reason::none ? guard : signalled();
  };
  const run::RunOutcome outcome = on_rig ? run.go_guarded(poll) : run.go(poll);
  if (!outcome.ran) throw driver::Unavailable(realtime_refusal(outcome.realtime));

  const runtime::CycleStatistics& statistics = run.executive().statistics();
  const diagnosis::LatencyRun measured{.rate_Hz = s.control.rate_Hz,
                                       .duration_s = options.duration_s,
                                       .cycles = statistics.cycles(),
                                       .realtime = outcome.realtime.realtime(),
                                       .timing = statistics.summary(),
                                       .wire = run.driver().answer_times()};
  if (histogram) histogram->write(runtime::cyclictest_histogram(statistics));
  cli::print(files::for_people(), "{}",
             options.json ? to_json(measured, facts).dump(2) + "\n" : to_text(measured, facts));
  if (!options.json) {
    for (const std::string& line : run.driver().tally()) cli::print(files::for_people(), "{}\n", line);
  }
  if (monitor) {
    run.release_driver();  // the guard reads the board back before it believes that the run is over
    monitor->end();
  }
  if (!outcome.completed())
    spdlog::error("ended early: {}", rig::reason_with_value(outcome.reason, outcome.reason_value));
  return status_of(outcome);
}

}  // namespace

Action add_doctor(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<DoctorOptions>();
  add_backend_option(parser, o->sources);
  add_configuration_options(parser, o->sources);
  parser.add("--only", &o->only, "run only this check", {.one_of = diagnosis::check_names()});
  parser.add("--json", &o->json, "print JSON instead of text");
  return [o] { return doctor(config::merged_settings(o->sources), o->only, o->json); };
}

Action add_latency(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<LatencyOptions>();
  add_backend_option(parser, o->sources);
  add_configuration_options(parser, o->sources);
  add_timing_options(parser, o->sources, o->histogram_file);
  parser.add("--duration", &o->duration_s, "duration of the test, s",
             {.type = "S", .range = {0.0, longest_load_s}, .show_default = true});
  parser.add("--secaligned", &o->second_offset_us,
             "begin at a whole second plus this many us, like cyclictest's option of the same name",
             {.type = "US", .range = {0, 999'999}});
  parser.add("--json", &o->json, "print JSON instead of text");
  return [o] { return latency(*o); };
}

}  // namespace abs_hil::program
