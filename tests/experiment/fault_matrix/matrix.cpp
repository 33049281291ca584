#include "matrix.hpp"

#include <array>
#include <memory>
#include <utility>

#include "abs_hil/driver/injection/injecting_driver.hpp"
#include "experiment/simulated_run.hpp"

namespace abs_hil::experiment::test {

namespace {

using rig::Phase;

constexpr std::array phases{Phase::idle, Phase::accelerate, Phase::coast, Phase::brake, Phase::hold, Phase::stopped};

/// The paper's experiment with longer pauses, so that a fault has time to act in each phase.
Setup matrix_setup() {
  Setup setup;
  setup.control.controller = "adaptive";
  setup.experiment.idle_s = 0.3;
  setup.experiment.coast_s = 0.3;
  setup.experiment.stopped_s = 0.3;
  setup.gate.supply_min_V = 15.0;
  return setup;
}

MatrixCase run_with(std::vector<driver::Injection> injections) {
  const Setup setup = matrix_setup();
  runtime::VirtualClock clock;
  auto sim = std::make_unique<driver::SimDriver>(setup.plant, driver::SimStart{.seed = setup.seed});
  const driver::SimDriver& rig = *sim;
  driver::InjectingDriver driver(std::move(sim), std::move(injections), 1, [&clock](std::int64_t duration_ns) {
    clock.sleep_until(clock.now_ns() + duration_ns);
  });
  Recorder recorder;
  analysis::RunMetrics metrics(setup.plant.rig.wheels.r2_m, setup.experiment.end_speed_m_s);
  RunSession session(clock, driver, logic_parts(setup), setup.gate, {&recorder, &metrics});
  const RunOutcome outcome = session.run_fast([] { return rig::Reason::none; });

  MatrixCase result{.reason = outcome.reason, .metrics = metrics.metrics()};
  const rig::CycleRecord& last = recorder.records.back();
  const std::int64_t effect_ns = driver.first_effect_ns();
  result.reaction_s = effect_ns < 0 ? 0.0 : static_cast<double>(clock.now_ns() - effect_ns) * 1e-9;
  const plant_sim::PlantInput& wire = rig.outputs();
  result.safe = outcome.safe_state.ok() && wire.motor_duty == 0.0 && wire.brake_duty == 0.0 &&
                wire.brake_torque_Nm == 0.0 && last.command.motor_duty == 0.0 && last.command.brake_duty == 0.0 &&
                !last.command.motor_enable;
  result.complete = session.record_drops() == 0 && last.reason == outcome.reason &&
                    recorder.records.size() == session.executive().statistics().cycles();
  for (std::size_t i = 0; i < recorder.records.size(); ++i) {
    result.complete = result.complete && recorder.records[i].sequence == i;
  }
  return result;
}

}  // namespace

std::vector<driver::Injection> all_injections() {
  std::vector<driver::Injection> all;
  for (std::size_t signal = 0; signal < driver::injection_signal_count; ++signal) {
    for (std::size_t kind = 0; kind < driver::injection_kind_count; ++kind) {
      for (const Phase phase : phases) {
        // Holding lasts some 30 ms.
        const std::string delay = phase == Phase::hold ? "+10ms" : "+100ms";
        all.push_back(
            driver::parse_injection(std::string(rig::name_of(phase)) + '@' +
                                    std::string(driver::name_of(static_cast<driver::InjectionSignal>(signal))) + ':' +
                                    std::string(driver::name_of(static_cast<driver::InjectionKind>(kind))) + delay));
      }
    }
  }
  return all;
}

MatrixCase run_case(const driver::Injection& injection) {
  MatrixCase result = run_with({injection});
  result.injection = injection;
  return result;
}

analysis::Metrics metrics_without_fault() { return run_with({}).metrics; }

}  // namespace abs_hil::experiment::test
