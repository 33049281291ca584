// The stream of a run's messages: order, decimation, status.
#include "telemetry/message_stream.hpp"

#include <cmath>
#include <stdexcept>
#include <vector>

#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/sample_records.hpp"

namespace abs_hil::telemetry {
namespace {

ExperimentInfo info() {
  return {{0, 0, "paper", "adaptive", "paper-table1", "sim", R"({"plant":{"theta_N":23}})", "0.1.0"}, {}};
}

template <class Message>
void check_consecutive(const std::vector<Message>& messages) {
  for (std::size_t i = 0; i < messages.size(); ++i) REQUIRE(messages[i].sequence == static_cast<std::int64_t>(i));
}

TEST_CASE("every record becomes a telemetry message with consecutive sequence numbers") {
  test::CapturingOutlet outlet;
  MessageStream stream({}, info(), {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 500; ++i) stream.consume(test::sample_record(i), 0.001 * static_cast<double>(i));
  const auto messages = outlet.all<telemetry_t>("ABS_TELEMETRY");
  REQUIRE(messages.size() == 500);
  check_consecutive(messages);
  CHECK(messages[321].cycle == 321);
  CHECK(messages[321].distance_m == 0.001 * 321.0);
  CHECK(messages[321].omega1_rad_s == test::sample_record(321).truth.speeds.omega1_rad_s);
}

TEST_CASE("a controller's own signals come with their names in each telemetry message") {
  test::CapturingOutlet outlet;
  ExperimentInfo with_signals = info();
  with_signals.names.signals = {"I_m", "zeta_N"};
  StreamOptions options;
  options.telemetry_every_cycles = 10;
  MessageStream stream(options, with_signals, {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 100; ++i) {
    rig::CycleRecord record = test::sample_record(i);
    record.control.signals = {static_cast<double>(i), -1.5, 3.0};
    stream.consume(record, 0.0);
  }
  const auto telemetry = outlet.all<telemetry_t>("ABS_TELEMETRY");
  REQUIRE(telemetry.size() == 10);
  for (const telemetry_t& message : telemetry) {
    CHECK(message.names.ends_with(",I_m,zeta_N"));
    const std::size_t size = message.values.size();
    REQUIRE(size == blank_message({}).values.size() + 2);  // there is no third signal
    CHECK(message.values[size - 2] == static_cast<double>(message.cycle));
    CHECK(message.values[size - 1] == -1.5);
  }
}

TEST_CASE("each cycle tells the experiment's own name of its phase") {
  test::CapturingOutlet outlet;
  ExperimentInfo named = info();
  named.names.phases = {{rig::Phase::brake, "brake-low"}, {rig::Phase::brake, "brake-high"}};
  MessageStream stream({}, named, {});
  stream.add(outlet);
  rig::CycleRecord record = test::sample_record(0);
  for (int n = 0; n < 3; ++n) {
    record.phase_index = n < 2 ? 0 : 1;
    if (n == 1) record.phase = rig::Phase::fault;  // it keeps the number
    stream.consume(record, 0.0);
    ++record.sequence;
    record.phase = rig::Phase::brake;
  }
  std::vector<std::string> told;
  for (const telemetry_t& message : outlet.all<telemetry_t>("ABS_TELEMETRY")) told.push_back(message.phase_name);
  CHECK(told == std::vector<std::string>{"brake-low", "fault", "brake-high"});
}

TEST_CASE("decimation keeps one cycle in N, whatever records are missing") {
  test::CapturingOutlet outlet;
  StreamOptions options;
  options.telemetry_every_cycles = 10;
  MessageStream stream(options, info(), {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 100; ++i) {
    if (i != 30 && i != 31 && (i < 50 || i >= 70)) stream.consume(test::sample_record(i), 0.0);
  }
  const auto messages = outlet.all<telemetry_t>("ABS_TELEMETRY");
  check_consecutive(messages);
  std::vector<std::int64_t> cycles;
  for (const auto& message : messages) cycles.push_back(message.cycle);
  CHECK(cycles == std::vector<std::int64_t>{0, 10, 20, 32, 40, 70, 80, 90});
}

TEST_CASE("status comes at the start, once a second of run time and at the end") {
  test::CapturingOutlet outlet;
  StatusSnapshot snapshot;
  snapshot.realtime = true;
  snapshot.timing.overruns.total = 3;
  snapshot.telemetry_drops = 4;
  snapshot.checks_unjudged = 0.125;
  snapshot.timing.wakeup_latency = {1.0, 2.0, 3.0, 4.0};
  snapshot.timing.cycle_time = {5.0, 6.0, 7.0, 8.0};
  std::uint64_t cycles = 0;
  MessageStream stream({}, info(), [&] {
    snapshot.cycles = cycles;
    return snapshot;
  });
  stream.add(outlet);
  for (; cycles < 3500; ++cycles) stream.consume(test::sample_record(cycles), 0.0);
  stream.finish();
  stream.finish();  // harmless
  const auto messages = outlet.all<status_t>("ABS_STATUS");
  check_consecutive(messages);
  std::vector<double> times_s;
  for (const auto& message : messages) times_s.push_back(message.time_s);
  CHECK(times_s == std::vector<double>{0.0, 1.0, 2.0, 3.0, 3.499});
  const status_t& last = messages.back();
  CHECK(last.cycles == 3500);
  CHECK(last.overruns == 3);
  CHECK(last.telemetry_drops == 4);
  CHECK(last.unjudged_share == 0.125);
  CHECK(last.realtime != 0);
  CHECK(last.publish_failures == 0);
  CHECK(last.phase == telemetry_t::PHASE_BRAKE);
  CHECK(last.wakeup_latency_p50_us == 1.0);
  CHECK(last.wakeup_latency_p99_us == 2.0);
  CHECK(last.wakeup_latency_p99_9_us == 3.0);
  CHECK(last.wakeup_latency_max_us == 4.0);
  CHECK(last.cycle_time_p50_us == 5.0);
  CHECK(last.cycle_time_p99_us == 6.0);
  CHECK(last.cycle_time_p99_9_us == 7.0);
  CHECK(last.cycle_time_max_us == 8.0);
}

TEST_CASE("the experiment is published at the start and every five seconds, also after a gap") {
  test::CapturingOutlet outlet;
  MessageStream stream({}, info(), {});
  stream.add(outlet);
  for (std::uint64_t i = 0; i < 16000; ++i) {
    if (i < 4000 || i >= 5500) stream.consume(test::sample_record(i), 0.0);
  }
  const auto messages = outlet.all<experiment_t>("ABS_EXPERIMENT");
  check_consecutive(messages);
  REQUIRE(messages.size() == 4);
  CHECK(messages[1].stamp_ns == test::sample_record(5500).stamp_ns);
  CHECK(messages[2].stamp_ns == test::sample_record(10000).stamp_ns);
  CHECK(messages[3].stamp_ns == test::sample_record(15000).stamp_ns);
  CHECK(messages[0].experiment == "paper");
  CHECK(messages[0].controller == "adaptive");
  CHECK(messages[0].plant == "paper-table1");
  CHECK(messages[0].backend == "sim");
  CHECK(messages[0].config_json == info().config_json);
  CHECK(messages[0].version == "0.1.0");
}

TEST_CASE("events carry stamp, phase, reason in number and words, and value") {
  test::CapturingOutlet outlet;
  MessageStream stream({}, info(), {});
  stream.add(outlet);
  stream.consume(test::sample_record(0), 0.0);
  rig::CycleRecord fault = test::sample_record(1);
  fault.phase = rig::Phase::fault;
  fault.reason = rig::Reason::overspeed;
  fault.reason_value = 201.5;
  stream.consume(fault, 0.0);
  stream.consume(fault, 0.0);
  const auto events = outlet.all<event_t>("ABS_EVENT");
  REQUIRE(events.size() == 2);
  check_consecutive(events);
  CHECK(events[1].kind == "fault");
  CHECK(events[1].stamp_ns == fault.stamp_ns);
  CHECK(events[1].time_s == fault.time_s);
  CHECK(events[1].phase == telemetry_t::PHASE_FAULT);
  CHECK(events[1].reason == 65);
  CHECK(events[1].reason_text == "wheel speed above the limit");
  CHECK(events[1].value == 201.5);
  CHECK(events[1].message ==
        "brake -> fault: wheel speed above the limit (speed 201.5 rad/s; bound: gate.overspeed_rad_s)");
}

TEST_CASE("all outlets get the same messages, and the same records give the same bytes again") {
  test::CapturingOutlet first, second, again;
  MessageStream stream({}, info(), {});
  stream.add(first);
  stream.add(second);
  MessageStream repeat({}, info(), {});
  repeat.add(again);
  for (std::uint64_t i = 0; i < 1200; ++i) {
    stream.consume(test::sample_record(i), 0.0);
    repeat.consume(test::sample_record(i), 0.0);
  }
  CHECK(first.messages == second.messages);
  CHECK(first.messages == again.messages);
}

TEST_CASE("the channel prefix is configurable and checked") {
  test::CapturingOutlet outlet;
  StreamOptions options;
  options.channel_prefix = "LAB2/ABS_";
  MessageStream stream(options, info(), {});
  stream.add(outlet);
  stream.consume(test::sample_record(0), 0.0);
  CHECK(stream.command_channel() == "LAB2/ABS_COMMAND");
  std::vector<std::string> channels;
  for (const auto& [channel, messages] : outlet.messages) channels.push_back(channel);
  CHECK(channels ==
        std::vector<std::string>{"LAB2/ABS_EVENT", "LAB2/ABS_EXPERIMENT", "LAB2/ABS_STATUS", "LAB2/ABS_TELEMETRY"});
  for (const char* bad : {"ABS.*", "(", "ABS ", "\xc3\xa4"}) {
    options.channel_prefix = bad;
    CHECK_THROWS_AS(MessageStream(options, info(), {}), std::invalid_argument);
  }
  options.channel_prefix = std::string(49, 'A');
  CHECK_THROWS_AS(MessageStream(options, info(), {}), std::invalid_argument);
}

TEST_CASE("options out of range are refused") {
  StreamOptions options;
  options.telemetry_every_cycles = 0;
  CHECK_THROWS_WITH(MessageStream(options, info(), {}), Catch::Matchers::Contains("telemetry_every_cycles"));
  options = {};
  options.status_period_s = 0.0;
  CHECK_THROWS_WITH(MessageStream(options, info(), {}), Catch::Matchers::Contains("status_period_s"));
  options = {};
  options.experiment_period_s = rig::unknown;
  CHECK_THROWS_WITH(MessageStream(options, info(), {}), Catch::Matchers::Contains("experiment_period_s"));
}

}  // namespace
}  // namespace abs_hil::telemetry
