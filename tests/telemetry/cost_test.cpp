// Measures the cost of a record: test_telemetry "[cost]". The test is hidden because it checks nothing.
#include <algorithm>
#include <chrono>
#include <cstdio>

#include "catch.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr int repetitions = 20;
constexpr std::uint64_t records = 20'000;

/// Shortest time of some repetitions, ns per record, because other programs may run.
template <class Consume>
void measure(const char* what, Consume consume) {
  double best_ns = 1e300;
  std::uint64_t first = 0;  // a stream is for one run: sequences go on
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    const auto start = std::chrono::steady_clock::now();
    for (std::uint64_t i = 0; i < records; ++i) consume(test::sample_record(first + i));
    const std::chrono::duration<double, std::nano> elapsed = std::chrono::steady_clock::now() - start;
    first += records;
    best_ns = std::min(best_ns, elapsed.count() / static_cast<double>(records));
  }
  std::printf("%-42s %8.0f ns a record\n", what, best_ns);
}

TEST_CASE("cost of a record", "[.][cost]") {
  const abs_hil::test::TemporaryFolder scratch;
  measure("making the sample record alone", [](const rig::CycleRecord& r) {
    if (r.time_s < 0.0) std::puts("never");
  });
  CsvSink csv(scratch / "run.csv");
  measure("CSV to a file", [&](const rig::CycleRecord& r) { csv.consume(r, 0.1); });
  CsvSink null("/dev/null");
  measure("CSV to /dev/null", [&](const rig::CycleRecord& r) { null.consume(r, 0.1); });

  EncodeBuffer buffer;
  std::size_t sum = 0;
  measure("to_message + encode",
          [&](const rig::CycleRecord& r) { sum += buffer.encode(to_message(r, 0.1, 1)).size(); });
  CHECK(sum > 0);

  LcmOutlet deaf("memq://");
  MessageStream to_nobody({}, {}, {});
  to_nobody.add(deaf);
  measure("stream to memq, no subscriber", [&](const rig::CycleRecord& r) { to_nobody.consume(r, 0.1); });

  std::size_t heard = 0;
  const auto count = [](const lcm_recv_buf_t*, const char*, void* counter) { ++*static_cast<std::size_t*>(counter); };
  LcmOutlet one("memq://");
  lcm_subscribe(one.lcm().getUnderlyingLCM(), "ABS_.*", count, &heard);
  MessageStream to_one({}, {}, {});
  to_one.add(one);
  measure("stream to memq, published and handled", [&](const rig::CycleRecord& r) {
    to_one.consume(r, 0.1);
    one.lcm().handle();
  });
  CHECK(heard > 0);

  LogOutlet log(scratch / "run.lcmlog", 0);
  MessageStream to_log({}, {}, {});
  to_log.add(log);
  measure("stream to an event log", [&](const rig::CycleRecord& r) { to_log.consume(r, 0.1); });
}

}  // namespace
}  // namespace abs_hil::telemetry
