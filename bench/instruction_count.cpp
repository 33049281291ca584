// Functions whose instructions callgrind counts: one for each budget (instruction_budget.py).

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "driver/sim/sim_driver.hpp"
#include "experiment/simulated_run.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/heartbeat.hpp"

using namespace abs_hil;

extern "C" {

/// Both speed observers, sequence, adaptive controller, actuator, then the gate: the control part of a cycle.
[[gnu::noinline]] void counted_control(experiment::RunLogic& logic, runtime::CommandGate& gate,
                                       const rig::Measurement& measurement, rig::CycleRecord& record) {
  const rig::Command wanted = logic.step(measurement, gate, record);
  record.command = gate.check(wanted, {record.control.speeds_est, record.phase, measurement.time_ns}).command;
}

/// What follows the write: gate, actuator model and anti-windup learn what was sent.
[[gnu::noinline]] void counted_sent(experiment::RunLogic& logic, runtime::CommandGate& gate, const rig::Command& sent) {
  gate.note_sent(sent);
  logic.commanded(sent);
}

/// The gate's check of the measurement.
[[gnu::noinline]] void counted_watch(runtime::CommandGate& gate, const rig::Measurement& measurement) {
  gate.check_measurement(measurement, measurement.time_ns);
}

[[gnu::noinline]] bool counted_ring_push(runtime::RecordRing& ring, const rig::CycleRecord& record) {
  return ring.push(record);
}

/// Heartbeat, check of the guardian's heartbeat, and flight recorder.
[[gnu::noipa]] bool counted_watchers(runtime::Heartbeat& watch, const rig::CycleRecord& record) {
  const runtime::GuardianSign guardian = watch.beat();
  watch.keep(record);
  return guardian.reason != rig::Reason::none;
}

[[gnu::noinline]] void counted_statistics(runtime::CycleStatistics& statistics, const rig::CycleTiming& timing) {
  statistics.add(timing);
}

}  // extern "C"

/// Brakes from 170 rad/s under slip control and prints the number of cycles. `bench_instruction_count
/// [CONTROLLER [DEAD_TIME_S]]`.
int main(int argc, char** argv) {
  experiment::test::Setup setup = experiment::test::braking(argc > 1 ? argv[1] : "adaptive");
  if (argc > 2) setup.plant.rig.brake.brake_dead_time_s = std::strtod(argv[2], nullptr);
  driver::SimDriver driver(setup.plant, {.seed = 1, .start_speed_rad_s = setup.experiment.start_speed_rad_s});
  driver.configure();
  driver.activate(0);
  experiment::RunLogic logic(experiment::test::logic_parts(setup));
  runtime::CommandGate gate = logic.make_gate(setup.gate);
  runtime::RecordRing ring(64);
  std::vector<runtime::FlightSlot> slots(2000);
  runtime::FlightRing recorder(slots);
  runtime::RunPage page;
  const runtime::GuardPage guard_page;
  runtime::Heartbeat watch(page, guard_page, recorder, 1'000'000);
  const auto statistics = std::make_unique<runtime::CycleStatistics>();

  rig::Measurement measurement;
  rig::CycleRecord record, taken;
  rig::Command sent;
  int cycles = 0;
  for (bool braking = true; braking; ++cycles) {
    record = {};
    if (!driver.read(cycles * std::int64_t{1'000'000}, measurement).ok()) return EXIT_FAILURE;
    counted_watch(gate, measurement);
    counted_control(logic, gate, measurement, record);
    if (!driver.write(record.command, sent).ok()) return EXIT_FAILURE;
    record.command = sent;
    counted_sent(logic, gate, sent);
    braking = record.phase == rig::Phase::brake;
    record.timing = {.wakeup_latency_ns = 20'000, .read_ns = 3'000, .control_ns = 1'000, .write_ns = 500};
    counted_statistics(*statistics, record.timing);
    if (!counted_ring_push(ring, record)) return EXIT_FAILURE;
    if (counted_watchers(watch, record)) return EXIT_FAILURE;
    ring.pop(taken);
  }
  std::printf("%d\n", cycles);
  return cycles > 1'500 ? EXIT_SUCCESS : EXIT_FAILURE;
}
