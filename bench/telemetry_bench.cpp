// Cost of a cycle on the slow side: encoding a message, publishing it within the process, a row of CSV, an event in the
// log.

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "experiment/simulated_run.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_codec.hpp"

namespace {

using namespace abs_hil;

const std::vector<rig::CycleRecord>& records() {
  static const auto kept = experiment::test::simulated(experiment::test::braking("adaptive")).records;
  return kept;
}

/// Calls `one(record)` for the records in turn, repeatedly; counts bytes and cycles.
template <class One>
void for_each_record(benchmark::State& state, const One& one) {
  std::size_t next = 0;
  for (auto _ : state) {
    one(records()[next]);
    if (++next == records().size()) next = 0;
  }
  state.SetItemsProcessed(state.iterations());
}

std::filesystem::path scratch(const char* name) { return std::filesystem::temp_directory_path() / name; }

void encode(benchmark::State& state) {
  telemetry::EncodeBuffer buffer;
  for_each_record(state, [&](const rig::CycleRecord& record) {
    benchmark::DoNotOptimize(buffer.encode(telemetry::to_message(record, 1.0, 1)));
  });
}

void publish_in_process(benchmark::State& state) {
  telemetry::LcmOutlet outlet("memq://");
  telemetry::EncodeBuffer buffer;
  const std::string channel = "ABS_TELEMETRY";
  for_each_record(state, [&](const rig::CycleRecord& record) {
    outlet.send(channel, buffer.encode(telemetry::to_message(record, 1.0, 1)), record.time_s);
    outlet.lcm().handleTimeout(0);  // memq keeps messages until they are handled
  });
}

void csv_row(benchmark::State& state) {
  const auto file = scratch("abs_hil_bench.csv");
  {
    telemetry::CsvSink sink(file);
    for_each_record(state, [&](const rig::CycleRecord& record) { sink.consume(record, 1.0); });
  }
  std::filesystem::remove(file);
}

void log_event(benchmark::State& state) {
  const auto file = scratch("abs_hil_bench.lcmlog");
  {
    telemetry::LogOutlet outlet(file, 0);
    telemetry::EncodeBuffer buffer;
    const std::string channel = "ABS_TELEMETRY";
    for_each_record(state, [&](const rig::CycleRecord& record) {
      outlet.send(channel, buffer.encode(telemetry::to_message(record, 1.0, 1)), record.time_s);
    });
  }
  std::filesystem::remove(file);
}

BENCHMARK(encode);
BENCHMARK(publish_in_process);
// Limits the files to a size that fits a small disk.
BENCHMARK(csv_row)->Iterations(500'000);
BENCHMARK(log_event)->Iterations(500'000);

}  // namespace
