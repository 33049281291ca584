// The listener for commands over LCM: which ones it takes, and what it answers.
#include "commands/command_listener.hpp"

#include <thread>

#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::telemetry {
namespace {

/// A listener on memq whose answers are captured.
struct Bench {
  LcmOutlet outlet{"memq://"};
  test::CapturingOutlet captured;
  MessageStream stream{{}, {}, {}};
  int stop_calls{0};
  commands::CommandListener listener{outlet, stream, [this] { ++stop_calls; }};

  Bench() {
    stream.add(captured);
    stream.consume(test::sample_record(0), 0.0);
    captured.messages.clear();
  }
  void send(std::span<const std::uint8_t> packet) {
    REQUIRE(outlet.lcm().publish("ABS_COMMAND", packet.data(), static_cast<unsigned int>(packet.size())) == 0);
  }
  void send(const std::string& command, const std::string& sender = {}) {
    command_t message{};
    message.command = command;
    message.sender = sender;
    EncodeBuffer buffer;
    send(buffer.encode(message));
  }
  [[nodiscard]] std::vector<event_t> answers() const { return captured.all<event_t>("ABS_EVENT"); }
};

TEST_CASE("polling without any message returns at once") {
  Bench bench;
  bench.listener.poll();
  CHECK(bench.listener.listening());
  CHECK_FALSE(bench.listener.stop_requested());
  CHECK(bench.answers().empty());
}

TEST_CASE("stop is accepted from any sender and answered") {
  Bench bench;
  bench.send("stop", "tok\n1");
  bench.listener.poll();
  CHECK(bench.listener.stop_requested());
  CHECK(bench.stop_calls == 1);
  const auto answers = bench.answers();
  REQUIRE(answers.size() == 1);
  CHECK(answers[0].kind == "command");
  CHECK(answers[0].reason == static_cast<int>(rig::Reason::stop_command));
  CHECK(answers[0].message == "stop accepted (sender 'tok\uFFFD1')");
  CHECK(answers[0].stamp_ns == test::sample_record(0).stamp_ns);
}

TEST_CASE("any other command is refused with a reason") {
  Bench bench;
  for (const char* command : {"start", "STOP", "stop ", "", "set"}) bench.send(command, "t");
  bench.listener.poll();
  CHECK_FALSE(bench.listener.stop_requested());
  CHECK(bench.stop_calls == 0);
  CHECK(bench.listener.counts().refused == 5);
  const auto answers = bench.answers();
  REQUIRE(answers.size() == 5);
  CHECK(answers[0].message ==
        "refused 'start': only 'stop' is accepted, as this run has commands.enabled = false (sender 't')");
  CHECK(answers[0].reason == static_cast<int>(rig::Reason::commands_not_enabled));
}

TEST_CASE("garbage, truncated, foreign and oversized packets are only counted and answered") {
  Bench bench;
  command_t stop{};
  stop.command = "stop";
  EncodeBuffer buffer;
  const auto whole = buffer.encode(stop);
  EncodeBuffer other;
  const std::vector<std::uint8_t> huge(100'000, 0x5A);
  const std::vector<std::uint8_t> garbage(40, 0xA5);
  bench.send(garbage);
  bench.send(whole.first(whole.size() - 1));
  bench.send(whole.first(0));
  bench.send(other.encode(telemetry_t{}));
  bench.send(huge);
  bench.listener.poll();
  CHECK(bench.listener.counts().malformed == 5);
  CHECK_FALSE(bench.listener.stop_requested());
  CHECK(bench.answers().size() == 5);

  bench.send(whole);  // and the listener still works
  bench.listener.poll();
  CHECK(bench.listener.stop_requested());
}

TEST_CASE("a flood gets few answers, but a stop in it is accepted and answered") {
  Bench bench;
  for (int i = 0; i < 25; ++i) bench.send("flood");
  bench.send("stop", "me");
  bench.listener.poll();
  CHECK(bench.listener.counts().refused == 25);
  CHECK(bench.stop_calls == 1);
  auto answers = bench.answers();
  REQUIRE(answers.size() == 11);
  CHECK(answers.back().message == "stop accepted (sender 'me')");

  bench.stream.consume(test::sample_record(1000), 0.0);  // a second later there are answers again
  bench.send("flood");
  bench.listener.poll();
  CHECK(bench.answers().size() == 12);
}

TEST_CASE("a stop that the thread received is answered at the end; later packets are not received") {
  Bench bench;
  bench.listener.listen();
  bench.send("stop", "me");
  while (!bench.listener.stop_requested()) std::this_thread::yield();
  bench.stream.pass_time(7'000'000'000, 3.5);
  bench.listener.finish();
  const auto answers = bench.answers();
  REQUIRE(answers.size() == 1);
  CHECK(answers[0].message == "stop accepted (sender 'me')");
  CHECK(answers[0].stamp_ns == 7'000'000'000);
  CHECK(answers[0].time_s == 3.5);

  bench.send("stop", "too late");
  bench.listener.poll();
  CHECK_FALSE(bench.listener.listening());
  CHECK(bench.listener.counts().stops == 1);
  CHECK(bench.answers().size() == 1);
}

TEST_CASE("without a server nothing is received, and polling is harmless") {
  LcmOutlet outlet("tcpq://127.0.0.1:1");
  MessageStream stream({}, {}, {});
  commands::CommandListener listener(outlet, stream, {});
  listener.poll();
  CHECK_FALSE(listener.stop_requested());
}

TEST_CASE("a log file as LCM network has no listener") {
  const abs_hil::test::TemporaryFolder scratch;
  LcmOutlet outlet("file://" + (scratch / "x.lcmlog").string() + "?mode=w");
  MessageStream stream({}, {}, {});
  commands::CommandListener listener(outlet, stream, {});
  CHECK_FALSE(listener.listening());
  listener.poll();
}

}  // namespace
}  // namespace abs_hil::telemetry
