// Who may command a run from elsewhere: keys, message authentication, sequence numbers.
#include "commands/authority.hpp"

#include <sys/stat.h>

#include <cstdint>
#include <fstream>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "telemetry/message_capture.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::commands {

using Catch::Matchers::Contains;

TEST_CASE("A key that is not secret, or missing, is refused with its file and the fix") {
  const abs_hil::test::TemporaryFolder scratch;
  const auto refusal = [](const std::filesystem::path& file) -> std::string {
    try {
      static_cast<void>(read_key(file));
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "taken";
  };
  const auto with = [&](const std::string& text, mode_t mode) {
    const std::filesystem::path file = scratch / "key";
    std::ofstream(file) << text;
    ::chmod(file.c_str(), mode);
    return file;
  };
  CHECK_THAT(refusal(""), Contains("not set") && Contains("--set commands.key_file=commands.key"));
  CHECK_THAT(refusal(scratch / "nowhere"),
             Contains("nowhere' cannot be read: No such file") && Contains("openssl rand"));
  CHECK_THAT(refusal(scratch.path), Contains("is not a regular file"));
  const std::string sixteen = "0123456789abcdef";
  CHECK_THAT(refusal(with(sixteen, S_IRUSR | S_IWUSR | S_IROTH)), Contains("is accessible to all users: chmod o= "));
  CHECK_THAT(refusal(with(sixteen.substr(1) + " \n\n", S_IRUSR | S_IWUSR)), Contains("holds fewer than 16 characters"));
  CHECK(read_key(with(sixteen + " \r\n", S_IRUSR | S_IWUSR | S_IRGRP)) == sixteen);
}

TEST_CASE("A mac is the same for the same message and key, and differs for any change of either") {
  command_t command{};
  command.command = "slip-ref";
  command.value = 0.15;
  const std::string key = "0123456789abcdef";
  const std::string mac = mac_of(command, key);
  CHECK(mac.size() == 64);
  CHECK(mac.find_first_not_of("0123456789abcdef") == std::string::npos);
  CHECK(mac_of(command, key + "0") != mac);
  command.mac = mac;  // the mac of a message does not depend on its mac field
  CHECK(mac_of(command, key) == mac);
  command.value = 0.2;
  CHECK(mac_of(command, key) != mac);
}

TEST_CASE("Answers carry a tag that only the key makes, and that fits only their own content") {
  const std::string key = "0123456789abcdef";
  telemetry::test::CapturingOutlet sent;
  telemetry::MessageStream stream({}, {}, {});
  stream.add(sent);
  stream.answer_command(rig::Reason::stop_command, "stop accepted (sender 'me')", 1.0);
  sign_answers(stream, key);
  stream.answer_command(rig::Reason::stop_command, "stop accepted (sender 'me')", 1.0);
  stream.report_fault(rig::Reason::overspeed, 1.0, "too fast");
  const auto answers = sent.all<event_t>("ABS_EVENT");
  REQUIRE(answers.size() == 3);
  event_t bare = answers[0];
  CHECK_FALSE(take_tag(bare, key));
  CHECK(bare.message == "stop accepted (sender 'me')");
  event_t good = answers[1];
  CHECK(take_tag(good, key));
  CHECK(good.message == "stop accepted (sender 'me')");
  CHECK(answers[2].message == "too fast");
  const auto refused = [&](auto&& change) {
    event_t forged = answers[1];
    change(forged);
    return !take_tag(forged, key);
  };
  CHECK(refused([](event_t& e) { e.message.insert(0, "x"); }));
  CHECK(refused([](event_t& e) { e.reason = static_cast<std::int16_t>(rig::Reason::command_not_now); }));
  CHECK(refused([](event_t& e) { e.sequence += 1; }));
  CHECK(refused([](event_t& e) { e.message.replace(e.message.find("mac ") + 4, 1, "g"); }));
  CHECK(refused([](event_t& e) { e.message.pop_back(); }));
  CHECK(refused([](event_t& e) { e.message += ' '; }));
  event_t other = answers[1];
  CHECK_FALSE(take_tag(other, key + "0"));
}

TEST_CASE("A sequence number that leaps is refused and uses none up: a forged state cannot lock senders out") {
  const std::string key = "0123456789abcdef";
  Authority authority(key);
  const auto judge = [&](std::int64_t sequence) {
    command_t command{};
    command.session = authority.session();
    command.sequence = sequence;
    command.command = "slip-ref";
    command.mac = mac_of(command, key);
    return authority.judge(command);
  };
  CHECK(judge(1) == rig::Reason::none);
  CHECK(judge(INT64_MAX) == rig::Reason::command_repeated);
  CHECK(judge(2 + sequence_leap_max) == rig::Reason::command_repeated);
  CHECK(authority.last_sequence() == 1);
  CHECK(judge(1 + sequence_leap_max) == rig::Reason::none);
  CHECK(judge(2 + sequence_leap_max) == rig::Reason::none);
  CHECK(judge(INT64_MIN) == rig::Reason::command_repeated);
}

}  // namespace abs_hil::commands
