// Rows and columns of the fault matrix: faults, phases, rigs, and what each must lead to.
#include "matrix.hpp"

#include <memory>
#include <utility>

#include "experiment/simulated_run.hpp"
#include "injection/injecting_driver.hpp"
#include "kept_files.hpp"
#include "matrix_rig.hpp"
#include "runtime/heartbeat.hpp"
#include "telemetry/csv_sink.hpp"

namespace abs_hil::experiment::test {

namespace {

using rig::Phase;

/// The paper's experiment with longer pauses, so that a fault can act in each phase.
Setup matrix_setup(Backend backend) {
  Setup setup;
  setup.control.controller = "adaptive";
  setup.experiment.idle_s = 0.3;
  setup.experiment.coast_s = 0.3;
  setup.experiment.stopped_s = 0.3;
  setup.gate.supply_min_V = 15.0;
  if (is_board(backend)) setup.gate.brake_duty_max = 0.7;  // the drivers' own cap
  if (backend == Backend::measured_step) setup.plant = shipped_plant("measured-step");
  if (backend == Backend::measured_relay) setup.plant = shipped_plant("measured-relay");
  return setup;
}

constexpr std::size_t recorder_slots = 2000;  ///< 2 s, as in the program

MatrixCase run_with(Backend backend, std::vector<config::Injection> injections, const std::filesystem::path& folder) {
  const Setup setup = matrix_setup(backend);
  runtime::VirtualClock clock;
  const std::unique_ptr<MatrixRig> rig = make_matrix_rig(backend, setup);
  injection::InjectingDriver driver(rig->driver(), std::move(injections), 1, [&clock](std::int64_t duration_ns) {
    clock.sleep_until(clock.now_ns() + duration_ns);
  });
  std::vector<runtime::FlightSlot> slots(recorder_slots);
  runtime::FlightRing flight(slots);
  runtime::RunPage page;
  const runtime::GuardPage guard_page;
  runtime::Heartbeat heartbeat(page, guard_page, flight);
  Recorder recorder;
  telemetry::CsvSink csv(folder / "run.csv");
  SetupRun run(setup, {.clock = &clock, .driver = &driver});
  run->record_into({&recorder, &csv});
  run->set_watch(heartbeat);
  const run::RunOutcome outcome = run->go(go_on);

  MatrixCase result{.reason = outcome.reason, .metrics = run->metrics().metrics()};
  const rig::CycleRecord& last = recorder.records.back();
  const std::int64_t effect_ns = driver.first_effect_ns();
  result.reaction_s = effect_ns < 0 ? 0.0 : static_cast<double>(clock.now_ns() - effect_ns) * 1e-9;
  result.safe = outcome.safe_state.ok() && rig->at_rest() && last.command.motor_duty == 0.0 &&
                last.command.brake_duty == 0.0 && !last.command.motor_enable;
  result.complete = run->record_drops() == 0 && last.reason == outcome.reason &&
                    recorder.records.size() == run->executive().statistics().cycles();
  for (std::size_t i = 0; i < recorder.records.size(); ++i) {
    result.complete = result.complete && recorder.records[i].sequence == i;
  }
  result.lost = fault_of_csv(folder / "run.csv", recorder.records);
  if (result.lost.empty() && !result.survived()) {
    result.lost = fault_of_recorder(flight, slots.size(), recorder.records, folder / "recorder");
  }
  return result;
}

}  // namespace

std::vector<rig::Phase> phases_of(Backend backend) {
  if (is_board(backend)) return {Phase::accelerate, Phase::brake};
  return {Phase::idle, Phase::accelerate, Phase::coast, Phase::brake, Phase::hold, Phase::stopped};
}

std::vector<config::Injection> all_injections(Backend backend) {
  std::vector<config::Injection> all;
  for (std::size_t signal = 0; signal < config::injection_signal_count; ++signal) {
    for (std::size_t kind = 0; kind < config::injection_kind_count; ++kind) {
      for (const Phase phase : phases_of(backend)) {
        // The hold phase lasts some 30 ms.
        const std::string delay = phase == Phase::hold ? "+10ms" : "+100ms";
        all.push_back(
            config::parse_injection(std::string(rig::name_of(phase)) + '@' +
                                    std::string(config::name_of(static_cast<config::InjectionSignal>(signal))) + ':' +
                                    std::string(config::name_of(static_cast<config::InjectionKind>(kind))) + delay));
      }
    }
  }
  return all;
}

MatrixCase run_case(Backend backend, const config::Injection& injection, const std::filesystem::path& folder) {
  MatrixCase result = run_with(backend, {injection}, folder);
  result.injection = injection;
  return result;
}

analysis::Metrics metrics_without_fault(Backend backend, const std::filesystem::path& folder) {
  return run_with(backend, {}, folder).metrics;
}

}  // namespace abs_hil::experiment::test
