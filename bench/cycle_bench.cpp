// Cost of the parts of one cycle, each with its inputs from a braking run: plant tick, speed observer, every
// controller's step, gate, ring.

#include <benchmark/benchmark.h>

#include <vector>

#include "control/tracking_observer.hpp"
#include "experiment/simulated_run.hpp"
#include "runtime/spsc_ring.hpp"

namespace {

using namespace abs_hil;
using experiment::test::braking;

/// The braking phase of a run with the adaptive controller.
const std::vector<rig::CycleRecord>& braking_records() {
  static const auto records = experiment::test::simulated(braking("adaptive")).in_phase(rig::Phase::brake);
  return records;
}

/// Calls `one(record)` for the records in turn, repeatedly.
template <class One>
void for_each_record(benchmark::State& state, const One& one) {
  const auto& records = braking_records();
  std::size_t next = 0;
  for (auto _ : state) {
    one(records[next]);
    if (++next == records.size()) next = 0;
  }
}

void plant_tick(benchmark::State& state) {
  plant_sim::Plant plant{{}};
  for_each_record(state, [&](const rig::CycleRecord& record) {
    if (record.sequence == braking_records().front().sequence) {
      plant.reset({.omega1_rad_s = 170.0, .omega2_rad_s = 170.0});
    }
    plant.advance(1e-3, {.brake_duty = record.command.brake_duty});
  });
  benchmark::DoNotOptimize(plant.state());
}

void observer(benchmark::State& state) {
  control::TrackingObserver observer({}, 4096);
  for_each_record(state,
                  [&](const rig::CycleRecord& record) { observer.update(record.measurement.upper_counts, 1e-3); });
  benchmark::DoNotOptimize(observer.omega_rad_s());
}

void controller_step(benchmark::State& state, std::string_view name) {
  const experiment::test::Setup setup;
  const auto controller = control::make_controller(name, {setup.control, setup.plant.rig});
  const auto input = [](const rig::CycleRecord& record) {
    const rig::ControlState& c = record.control;
    return control::SlipInput{.dt_s = 1e-3,
                              .speeds = c.speeds_est,
                              .slip = c.slip_est,
                              .slip_ref = c.slip_ref,
                              .mean_brake_torque_Nm = c.brake_torque_est_Nm,
                              .brake_torque_Nm = c.brake_torque_est_Nm,
                              .max_brake_torque_Nm = 9.03,
                              .alpha1_rad_s2 = -70.0,
                              .alpha2_rad_s2 = -70.0,
                              .upper_travel_rad = 1e-3 * c.speeds_est.omega1_rad_s,
                              .lower_travel_rad = 1e-3 * c.speeds_est.omega2_rad_s};
  };
  for_each_record(state, [&](const rig::CycleRecord& record) {
    if (record.sequence == braking_records().front().sequence) controller->reset(input(record));
    benchmark::DoNotOptimize(controller->step(input(record)));
  });
}

void gate(benchmark::State& state) {
  runtime::CommandGate gate{runtime::GateOptions{}};
  for_each_record(state, [&](const rig::CycleRecord& record) {
    benchmark::DoNotOptimize(gate.check(record.command, {record.control.speeds_est, record.phase, record.stamp_ns}));
  });
}

void ring_push_and_pop(benchmark::State& state) {
  runtime::RecordRing ring(64);
  rig::CycleRecord taken;
  for_each_record(state, [&](const rig::CycleRecord& record) {
    ring.push(record);
    ring.pop(taken);
  });
  benchmark::DoNotOptimize(taken);
}

BENCHMARK(plant_tick);
BENCHMARK(observer);
BENCHMARK(gate);
BENCHMARK(ring_push_and_pop);

[[maybe_unused]] const bool registered = [] {
  for (const auto& entry : control::controllers()) {
    benchmark::RegisterBenchmark(("controller_step/" + std::string(entry.name)).c_str(), controller_step, entry.name);
  }
  return true;
}();

}  // namespace
