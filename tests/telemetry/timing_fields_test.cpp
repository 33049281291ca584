// The figures of each part of the cycle, on ABS_STATUS, ABS_TELEMETRY and the status line: each in its own field.

#include <cmath>

#include "catch.hpp"
#include "message_capture.hpp"
#include "sample_records.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/status_line.hpp"

using namespace abs_hil;
using namespace abs_hil::telemetry;

namespace {

StatusSnapshot timed() {
  StatusSnapshot s;
  s.timing.overruns.total = 15;
  s.telemetry_drops = 9;
  s.timing.wakeup_latency = {1, 2, 3, 4};
  s.timing.read = {5, 6, 7, 8};
  s.timing.control = {9, 10, 11, 12};
  s.timing.write = {13, 14, 15, 16};
  s.timing.cycle_time = {17, 18, 19, 20};
  s.timing.overruns = {.total = 15, .startup = 6, .ticks_missed = 40, .longest_run = 7, .by_cause = {0, 1, 2, 3, 4, 5}};
  return s;
}

}  // namespace

TEST_CASE("ABS_STATUS carries p50, p99, p99.9 and max of every part, and the late cycles by cause") {
  MessageStream stream({}, {}, timed);
  test::CapturingOutlet outlet;
  stream.add(outlet);
  stream.consume(test::sample_record(0), 0.0);
  const auto m = outlet.all<status_t>("ABS_STATUS").front();
  const std::vector<double> figures{
      m.wakeup_latency_p50_us, m.wakeup_latency_p99_us, m.wakeup_latency_p99_9_us, m.wakeup_latency_max_us,
      m.read_p50_us,           m.read_p99_us,           m.read_p99_9_us,           m.read_max_us,
      m.control_p50_us,        m.control_p99_us,        m.control_p99_9_us,        m.control_max_us,
      m.write_p50_us,          m.write_p99_us,          m.write_p99_9_us,          m.write_max_us,
      m.cycle_time_p50_us,     m.cycle_time_p99_us,     m.cycle_time_p99_9_us,     m.cycle_time_max_us};
  for (std::size_t i = 0; i < figures.size(); ++i) CHECK(figures[i] == static_cast<double>(i + 1));
  CHECK(m.telemetry_drops == 9);
  const std::vector<std::int64_t> causes{m.overruns_wakeup, m.overruns_read, m.overruns_control, m.overruns_write,
                                         m.overruns_record};
  CHECK(causes == std::vector<std::int64_t>{1, 2, 3, 4, 5});
  CHECK(m.overruns_startup == 6);
  CHECK(m.overruns_longest_run == 7);
  CHECK(m.ticks_missed == 40);
}

TEST_CASE("ABS_TELEMETRY carries the recording time and why ticks were missed") {
  rig::CycleRecord record = test::sample_record(0);
  record.timing.record_ns = 321;
  record.timing.overrun_cause = rig::OverrunCause::write;
  const telemetry_t m = to_message(record, 0.0, 0);
  CHECK(m.record_ns == 321);
  CHECK(m.overrun_cause == 4);
}

TEST_CASE("the status line ends with wake-up latency and cycle time once there are any") {
  CHECK_THAT(format_status_line(test::sample_record(0), timed()),
             Catch::Matchers::EndsWith("drops 9  gate 0  wake-up 1/2/3/4 us  cycle 17/18/19/20 us"));
  CHECK_THAT(format_status_line(test::sample_record(0), {}), Catch::Matchers::EndsWith("drops 0  gate 0"));
}
