// Event logs: read back, times, replacing an older one.
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <map>

#include "catch.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::uint64_t record_count = 3000;

void write_log(const std::filesystem::path& path, std::optional<std::int64_t> epoch_us) {
  LogOutlet log(path, epoch_us);
  MessageStream stream({}, {{0, 0, "paper", "adaptive", "paper-table1", "sim", "{}", "0.1.0"}}, {});
  stream.add(log);
  for (std::uint64_t i = 0; i < record_count; ++i) stream.consume(test::sample_record(i), 0.0);
  stream.finish();
  CHECK(log.failures() == 0);
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST_CASE("a log read back holds every record, consecutively, at its run time") {
  const abs_hil::test::TemporaryFolder scratch;
  constexpr std::int64_t epoch_us = 1'000'000'000;
  write_log(scratch / "run.lcmlog", epoch_us);

  lcm::LogFile log((scratch / "run.lcmlog").string(), "r");
  REQUIRE(log.good());
  std::map<std::string, std::int64_t> count;
  std::int64_t event_count = 0;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    REQUIRE(event->eventnum == event_count++);
    const std::int64_t sequence = count[event->channel]++;
    const auto* data = static_cast<const std::uint8_t*>(event->data);
    const test::Bytes bytes(data, data + event->datalen);
    if (event->channel == "ABS_TELEMETRY") {
      const auto message = test::decoded<telemetry_t>(bytes);
      REQUIRE(message.sequence == sequence);
      REQUIRE(message.cycle == sequence);
      REQUIRE(message.omega1_rad_s ==
              test::sample_record(static_cast<std::uint64_t>(sequence)).truth.speeds.omega1_rad_s);
      REQUIRE(event->timestamp == epoch_us + sequence * 1000);
    } else if (event->channel == "ABS_STATUS") {
      REQUIRE(test::decoded<status_t>(bytes).sequence == sequence);
    }
  }
  CHECK(count == std::map<std::string, std::int64_t>{{"ABS_TELEMETRY", static_cast<std::int64_t>(record_count)},
                                                     {"ABS_STATUS", 4},
                                                     {"ABS_EVENT", 1},
                                                     {"ABS_EXPERIMENT", 1}});
}

TEST_CASE("logs on virtual time are byte-identical") {
  const abs_hil::test::TemporaryFolder scratch;
  write_log(scratch / "a.lcmlog", 0);
  write_log(scratch / "b.lcmlog", 0);
  CHECK(bytes_of(scratch / "a.lcmlog") == bytes_of(scratch / "b.lcmlog"));
}

TEST_CASE("without an epoch the times are wall clock with the spacing of the records") {
  const abs_hil::test::TemporaryFolder scratch;
  write_log(scratch / "run.lcmlog", std::nullopt);
  lcm::LogFile log((scratch / "run.lcmlog").string(), "r");
  REQUIRE(log.good());
  const std::int64_t first_us = log.readNextEvent()->timestamp;
  CHECK(first_us > 1'600'000'000'000'000);  // 2020
  std::int64_t last_us = first_us;
  while (const lcm::LogEvent* event = log.readNextEvent()) last_us = event->timestamp;
  CHECK(last_us - first_us == static_cast<std::int64_t>(record_count - 1) * 1000);
}

TEST_CASE("finish() reports a full disk; messages that were not written are counted") {
  LogOutlet log("/dev/full", 0);
  test::CapturingOutlet other;
  MessageStream stream({}, {}, {});
  stream.add(log);
  stream.add(other);
  for (std::uint64_t i = 0; i < record_count; ++i) stream.consume(test::sample_record(i), 0.0);
  CHECK(log.failures() > 0);
  CHECK(stream.failures() == log.failures());
  CHECK_THROWS_WITH(stream.finish(),
                    Catch::Matchers::Contains("/dev/full") && Catch::Matchers::Contains("No space left"));
  CHECK(other.all<telemetry_t>("ABS_TELEMETRY").size() == record_count);  // the other outlet goes on
}

TEST_CASE("an older log stays until the run has begun") {
  const abs_hil::test::TemporaryFolder scratch;
  const auto path = scratch / "run.lcmlog";
  std::ofstream(path) << "older";
  { LogOutlet refused(path, 0, 0.05); }
  CHECK(bytes_of(path) == "older");
  const test::Bytes bytes{1, 2, 3};
  LogOutlet log(path, 0, 0.05);
  log.send("X", bytes, 0.0);
  CHECK(bytes_of(path) == "older");
  log.send("X", bytes, 0.06);
  CHECK(bytes_of(path).size() == 2 * (28 + 1 + 3));  // what a killed program leaves
}

TEST_CASE("a full disk is noticed even if everything fitted the buffer of the log") {
  LogOutlet log("/dev/full", 0);
  const test::Bytes bytes{1, 2, 3};
  log.send("X", bytes, 0.0);
  CHECK_THROWS_AS(log.finish(), files::FileError);
}

TEST_CASE("a log that cannot be opened is refused with path, reason and fix") {
  const abs_hil::test::TemporaryFolder scratch;
  const auto missing = scratch.path / "nowhere" / "run.lcmlog";
  CHECK_THROWS_WITH(LogOutlet(missing), Catch::Matchers::Contains(missing.string()) &&
                                            Catch::Matchers::Contains("No such file or directory") &&
                                            Catch::Matchers::Contains("mkdir -p"));
  CHECK_THROWS_WITH(LogOutlet(scratch.path), Catch::Matchers::Contains("add a file name"));
}

}  // namespace
}  // namespace abs_hil::telemetry
