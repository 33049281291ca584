// The flight recorder: order, torn records, a writer that dies.
#include <atomic>
#include <thread>
#include <vector>

#include "catch.hpp"
#include "runtime/heartbeat.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

rig::CycleRecord numbered(std::uint64_t n) {
  rig::CycleRecord record;
  record.sequence = n;
  record.stamp_ns = static_cast<std::int64_t>(n) * 1000;
  record.time_s = static_cast<double>(n) * 1e-3;
  record.timing.record_ns = static_cast<std::int64_t>(n);
  return record;
}

bool of_one_piece(const rig::CycleRecord& record) {
  return record.stamp_ns == static_cast<std::int64_t>(record.sequence) * 1000 &&
         record.timing.record_ns == static_cast<std::int64_t>(record.sequence);
}

}  // namespace

TEST_CASE("the recorder keeps the latest records in order, however many there were") {
  for (const std::uint64_t pushed : {0U, 1U, 4U, 5U, 6U, 17U}) {
    std::vector<FlightSlot> slots(5);
    FlightRing ring(slots);
    for (std::uint64_t n = 0; n < pushed; ++n) ring.push(numbered(n));
    const std::uint64_t kept = std::min<std::uint64_t>(pushed, 5);
    const auto records = ring.contents();
    CAPTURE(pushed);
    REQUIRE(records.size() == kept);
    for (std::uint64_t i = 0; i < kept; ++i) {
      CHECK(records[i].sequence == pushed - kept + i);
      CHECK(of_one_piece(records[i]));
    }
  }
}

TEST_CASE("only the record that a killed writer left half written is missing") {
  std::vector<FlightSlot> slots(4);
  FlightRing ring(slots);
  for (std::uint64_t n = 0; n < 6; ++n) ring.push(numbered(n));
  slots[2].version.store(slots[2].version.load() + 1);  // as in the midst of push number 6
  const auto records = ring.contents();
  REQUIRE(records.size() == 3);
  CHECK(records[0].sequence == 3);
  CHECK(records[2].sequence == 5);
}

TEST_CASE("a reader during writing never sees a mixture of two records") {
  std::vector<FlightSlot> slots(3);
  std::atomic<bool> done{false};
  std::atomic<std::size_t> seen{0};
  std::thread writer([&] {
    FlightRing ring(slots);
    // On a busy machine the reader may not have had its turn by then.
    for (std::uint64_t n = 0; n < 200'000 || (seen == 0 && n < 1'000'000'000); ++n) ring.push(numbered(n));
    done = true;
  });
  bool whole = true;
  const FlightRing reader(slots);
  do {
    for (const rig::CycleRecord& record : reader.contents()) {
      ++seen;
      whole = whole && of_one_piece(record);
    }
  } while (!done);
  writer.join();
  CHECK(whole);
  CHECK(reader.contents().size() == 3);
  CHECK(seen > 0);
}

TEST_CASE("two seconds at the cycle's rate") {
  CHECK(FlightRing::slots_for(2.0, 1000.0) == 2000);
  CHECK(FlightRing::slots_for(2.0, 333.3) == 667);
  CHECK(FlightRing::slots_for(0.0, 1000.0) == 1);
}

TEST_CASE("each cycle beats before it writes, and leaves its record") {
  Bench bench;
  runtime::RunPage run;
  runtime::GuardPage guard;
  std::vector<FlightSlot> slots(8);
  FlightRing recorder(slots);
  runtime::Heartbeat heartbeat(run, guard, recorder);
  bench.executive.set_watch(heartbeat);
  for (std::uint64_t n = 1; n <= 3; ++n) {
    bench.cycle();
    CHECK(run.cycle_beats.load() == n);
  }
  const auto records = recorder.contents();
  REQUIRE(records.size() == 3);
  CHECK(records[2].sequence == 2);
  CHECK(records[2].command.brake_duty == 0.5);
}

TEST_CASE("a guardian without heartbeat for the limit of cycles is a fault, a slow one is not") {
  constexpr std::uint64_t limit = 5;
  Bench bench;
  runtime::RunPage run;
  runtime::GuardPage guard;
  std::vector<FlightSlot> slots(8);
  FlightRing recorder(slots);
  runtime::Heartbeat heartbeat(run, guard, recorder, limit);
  bench.executive.set_watch(heartbeat);
  for (int n = 0; n < 40; ++n) {
    if (n % 4 == 0) guard.guardian_beats.store(guard.guardian_beats.load() + 1);
    REQUIRE(bench.cycle());
  }
  REQUIRE(bench.logic.ended_by == rig::Reason::none);
  std::uint64_t cycles = 0;
  while (bench.cycle()) ++cycles;
  CHECK(bench.logic.ended_by == rig::Reason::guardian_silent);
  CHECK(bench.logic.ended_value == static_cast<double>(limit));
  CHECK(cycles <= limit);
  CHECK(bench.driver.written.back().brake_duty == 0.0);
}

TEST_CASE("a run without a guardian has no guardian fault") {
  Bench bench;
  runtime::RunPage run;
  runtime::GuardPage guard;
  std::vector<FlightSlot> slots(8);
  FlightRing recorder(slots);
  runtime::Heartbeat heartbeat(run, guard, recorder, 0);
  bench.executive.set_watch(heartbeat);
  for (int n = 0; n < 100; ++n) REQUIRE(bench.cycle());
}
