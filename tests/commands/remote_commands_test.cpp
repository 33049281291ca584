// Changes of a running controller from elsewhere, up to the end of the run.
#include "commands/remote_commands.hpp"

#include <sys/stat.h>

#include <fstream>

#include "abs_hil/adjustment_t.hpp"
#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::commands {
namespace {

using telemetry::test::sample_record;
constexpr const char* key = "a secret of sixteen characters or more";

config::Settings with_commands(const std::filesystem::path& key_file) {
  std::ofstream(key_file) << key << '\n';
  ::chmod(key_file.c_str(), S_IRUSR | S_IWUSR);
  config::Settings settings;
  settings.commands.enabled = true;
  settings.commands.key_file = key_file.string();
  settings.experiment.wait_for_start = true;
  return settings;
}

/// A run whose real-time thread takes changes only on request; its answers are captured.
struct Bench {
  abs_hil::test::TemporaryFolder scratch;
  telemetry::test::CapturingOutlet captured;
  telemetry::MessageStream stream{{}, {}, {}};
  RemoteCommands remote{with_commands(scratch / "key"), stream};
  experiment::AdjustmentMailbox mailbox;

  Bench() {
    stream.add(captured);
    remote.set_mailbox(mailbox);
    stream.set_before_end([this] { remote.refuse_pending(); });
    show(0, rig::Reason::none, 0);
  }
  /// The record of cycle `n`.
  void show(std::uint64_t n, rig::Reason reason, double value) {
    rig::CycleRecord record = sample_record(n);
    record.reason = reason;
    record.reason_value = value;
    stream.consume(record, 0.0);
    remote.consume(record, 0.0);
  }
  command_t slip_ref(std::int64_t sequence, double value) { return command(sequence, "slip-ref", value); }
  command_t command(std::int64_t sequence, const std::string& what, double value) {
    command_t command{};
    command.session = captured.all<command_state_t>("ABS_COMMAND_STATE").back().session;
    command.sequence = sequence;
    command.command = what;
    command.value = value;
    command.sender = std::to_string(sequence);
    command.mac = mac_of(command, key);
    return command;
  }
  [[nodiscard]] std::vector<event_t> answers() const {
    std::vector<event_t> found;
    for (event_t event : captured.all<event_t>("ABS_EVENT")) {
      if (event.kind != "command") continue;
      CHECK(take_tag(event, key));
      found.push_back(event);
    }
    return found;
  }
};

TEST_CASE("a change still pending at the run's end is refused, one that took effect is not") {
  Bench bench;
  REQUIRE_FALSE(bench.remote.judge(bench.slip_ref(1, 0.1)).has_value());
  REQUIRE_FALSE(bench.remote.judge(bench.slip_ref(2, 0.2)).has_value());
  bench.show(1, rig::Reason::slip_reference_changed, 1.0);  // the first has reached a cycle
  CHECK(bench.answers().size() == 1);

  bench.stream.finish();
  const auto answers = bench.answers();
  REQUIRE(answers.size() == 2);
  CHECK(answers[0].reason == static_cast<int>(rig::Reason::slip_reference_changed));
  CHECK(answers[1].reason == static_cast<int>(rig::Reason::command_not_now));
  CHECK(answers[1].message ==
        "refused: control.slip_ref = 0.2: the run ended before it could take effect (sender '2')");
  const auto states = bench.captured.all<command_state_t>("ABS_COMMAND_STATE");
  CHECK(states.back().accepted == 1);
  CHECK(bench.captured.all<adjustment_t>("ABS_ADJUSTMENT").size() == 1);

  bench.stream.finish();  // each change gets one answer
  CHECK(bench.answers().size() == 2);
}

TEST_CASE("after the run's end a command is refused with that reason") {
  Bench bench;
  bench.stream.finish();
  const auto answer = bench.remote.judge(bench.slip_ref(1, 0.1));
  REQUIRE(answer.has_value());
  CHECK(answer->reason == rig::Reason::command_not_now);
  CHECK(answer->message == "refused 'slip-ref': the run has ended");
}

TEST_CASE("a change refused for lack of room has no effect and can be sent again") {
  Bench bench;
  std::int64_t sequence = 0;
  std::optional<commands::CommandAnswer> answer;
  while (!answer) answer = bench.remote.judge(bench.slip_ref(++sequence, 0.1));
  CHECK(answer->message == "refused 'slip-ref': too many changes at once: send it again");
  CHECK(bench.remote.judge(bench.command(++sequence, "start", 0.0)).has_value());

  experiment::AdjustmentMailbox::Arrived arrived{};
  while (bench.mailbox.take(arrived)) {
  }
  CHECK_FALSE(bench.remote.judge(bench.command(++sequence, "start", 0.0)).has_value());
  REQUIRE(bench.mailbox.take(arrived));
  CHECK(arrived.kind == experiment::Adjustment::Kind::start);
}

TEST_CASE("continue answers the question of the present phase, and nothing else") {
  abs_hil::test::TemporaryFolder scratch;
  telemetry::test::CapturingOutlet captured;
  telemetry::MessageStream stream{{}, {}, {}};
  stream.add(captured);
  config::Settings settings = with_commands(scratch / "key");
  settings.experiment.answers = "person";
  rig::CycleRecord record = sample_record(0);
  RemoteCommands remote(settings, stream, {.phases = {{record.phase, "up", ""}, {record.phase, "lift", "Lift it."}}});
  experiment::AdjustmentMailbox mailbox;
  remote.set_mailbox(mailbox);
  const auto show = [&](std::uint16_t phase_index, rig::Reason reason) {
    ++record.sequence;
    record.phase_index = phase_index;
    record.reason = reason;
    stream.consume(record, 0.0);
    remote.consume(record, 0.0);
  };
  std::int64_t sequence = 0;
  const auto judge = [&] {
    command_t command{};
    command.session = captured.all<command_state_t>("ABS_COMMAND_STATE").back().session;
    command.sequence = ++sequence;
    command.command = "continue";
    command.sender = "s";
    command.mac = mac_of(command, key);
    return remote.judge(command);
  };
  show(0, rig::Reason::run_started);
  REQUIRE(judge().has_value());
  CHECK(judge()->message == "refused 'continue': the present phase asks nothing");
  show(1, rig::Reason::phase_duration_over);
  CHECK_FALSE(judge().has_value());
  experiment::AdjustmentMailbox::Arrived arrived{};
  REQUIRE(mailbox.take(arrived));
  CHECK(arrived.kind == experiment::Adjustment::Kind::answer);
  CHECK(judge()->reason == rig::Reason::command_not_now);  // one answer is enough
  CHECK(captured.all<adjustment_t>("ABS_ADJUSTMENT").empty());
  show(0, rig::Reason::question_answered);
  const auto adjustments = captured.all<adjustment_t>("ABS_ADJUSTMENT");
  REQUIRE(adjustments.size() == 1);
  CHECK(adjustments[0].name == "continue");
  CHECK(adjustments[0].cycle == static_cast<std::int64_t>(record.sequence));
  CHECK(captured.all<event_t>("ABS_EVENT").back().message.starts_with("accepted: continue (sender 's') [mac "));
  REQUIRE(judge().has_value());
}

}  // namespace
}  // namespace abs_hil::commands
