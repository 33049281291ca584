// Event logs: damaged, cut off, appended to one another, and with several runs.

#include "telemetry/event_log.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "abs_hil/experiment_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::telemetry {
namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put(const fs::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

/// A log with all kinds of messages.
void record(const fs::path& log_path, std::uint64_t cycles = 1200) {
  LogOutlet log(log_path, 1'000'000);
  MessageStream stream(
      {}, {{0, 0, "paper", "adaptive", "a, \"plant\"\nof two lines", "sim", R"({"a":{"b":[1,"x"]}})", "0"}}, {});
  stream.add(log);
  for (std::uint64_t n = 0; n < cycles; ++n) {
    rig::CycleRecord r = test::sample_record(n);
    if (n % 7 == 0) r.measurement.time_ns += 40;  // a board's own time
    if (n % 5 == 0) r.control.theta_est_N = rig::unknown;
    if (n % 11 == 0) r.truth.theta_N = -rig::unknown;  // NaN with a sign
    if (n == cycles / 2) r.phase = rig::Phase::hold;
    if (n == 13) r.truth.slip = -0.0;
    if (n == 14) r.truth.slip = 5e-324;
    stream.consume(r, 0.1 * static_cast<double>(n));
  }
  stream.answer_command(rig::Reason::none, "quoted \"text\", with comma", 1.0);
  stream.finish();
}

TEST_CASE("a log that is overwritten at any place is an error that names the place") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog");
  const auto count_events = [&](const std::string& bytes) {
    put(scratch / "x.lcmlog", bytes);
    int events = 0;
    static_cast<void>(for_each_event(scratch / "x.lcmlog", [&events](const LogEvent&) { ++events; }));
    return events;
  };
  using Catch::Matchers::Contains;
  CHECK_THROWS_WITH(count_events("hello, world, this is no event log"), Contains("not an LCM event log"));
  CHECK_THROWS_WITH(count_events("short"), Contains("not an LCM event log"));
  CHECK(count_events("") == 0);
  std::string damaged = content(scratch / "run.lcmlog");
  const std::size_t second = damaged.find("\xED\xA1\xDA\x01", 10);
  REQUIRE(second != std::string::npos);
  std::string sync = damaged, length = damaged, number = damaged;
  sync[second] = 'x';
  CHECK_THROWS_WITH(count_events(sync), Contains("damaged") && Contains("event 1 at byte " + std::to_string(second)));
  length[second + 24] = '\x7F';
  CHECK_THROWS_WITH(count_events(length), Contains("lengths"));
  length = damaged;
  length[second + 25] = '\x7F';
  CHECK_THROWS_WITH(count_events(length), Contains("other events follow"));
  number[second + 4] = '\x80';
  CHECK_THROWS_WITH(count_events(number), Contains("event number"));
  CHECK_THROWS_AS(EventLogReader(scratch / "none.lcmlog"), RecordingError);
}

TEST_CASE("the log of a killed run is read up to its last whole message") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", 10);
  const std::string whole = content(scratch / "run.lcmlog");
  std::vector<std::size_t> begins;
  for (std::size_t at = 0; at != std::string::npos; at = whole.find("\xED\xA1\xDA\x01", at + 1)) begins.push_back(at);
  begins.push_back(whole.size());
  for (std::size_t cut = begins[1]; cut < whole.size(); cut += 3) {
    put(scratch / "x.lcmlog", whole.substr(0, cut));
    std::size_t events = 0;
    const std::string note = for_each_event(scratch / "x.lcmlog", [&events](const LogEvent&) { ++events; });
    const auto next = std::upper_bound(begins.begin(), begins.end(), cut);
    REQUIRE(events == static_cast<std::size_t>(next - begins.begin()) - 1);
    REQUIRE(note.empty() == (*(next - 1) == cut));
    REQUIRE((note.empty() || note.find("cut off") != std::string::npos));
  }
}

/// What a reader finds in a file: events by part, and its note.
struct Found {
  std::vector<std::size_t> events{};
  std::string cut{};
};

Found read(const fs::path& path) {
  Found found;
  EventLogReader reader(path);
  while (const auto event = reader.next()) {
    found.events.resize(std::max(found.events.size(), event->part + 1));
    ++found.events[event->part];
  }
  found.cut = reader.cut();
  return found;
}

TEST_CASE("a recording that was appended to another one is read whole, wherever the first one is cut off") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", 10);
  const std::string whole = content(scratch / "run.lcmlog");
  std::vector<std::size_t> begins;
  for (std::size_t at = 0; at != std::string::npos; at = whole.find("\xED\xA1\xDA\x01", at + 1)) begins.push_back(at);
  const std::size_t events = begins.size();
  begins.push_back(whole.size());
  for (std::size_t cut = 4; cut <= whole.size(); ++cut) {
    put(scratch / "x.lcmlog", whole.substr(0, cut) + whole);
    const Found found = read(scratch / "x.lcmlog");
    const auto before =
        static_cast<std::size_t>(std::upper_bound(begins.begin(), begins.end(), cut) - begins.begin()) - 1;
    INFO(cut);
    REQUIRE(found.events == std::vector<std::size_t>{before, events});
    REQUIRE(found.cut.empty() == (begins[before] == cut));
    REQUIRE((found.cut.empty() ||
             found.cut.find("appended to it, begins at byte " + std::to_string(cut)) != found.cut.npos));
  }
}

TEST_CASE("any number of recordings that are cut off at once is read") {
  const abs_hil::test::TemporaryFolder scratch;
  std::string many;
  for (int n = 0; n < 100'000; ++n) many.append("\xED\xA1\xDA\x01").append(8, '\0');
  put(scratch / "x.lcmlog", many);
  const Found found = read(scratch / "x.lcmlog");
  CHECK(found.events.empty());
  CHECK(found.cut.size() < 2000);
}

TEST_CASE("damage in the middle is no appended recording") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", 10);
  const std::string whole = content(scratch / "run.lcmlog");
  std::string damaged = whole;
  damaged[whole.find("\xED\xA1\xDA\x01", 10)] = 'x';
  put(scratch / "x.lcmlog", damaged + whole);
  CHECK_THROWS_WITH(read(scratch / "x.lcmlog"), Catch::Matchers::Contains("no event begins here"));
}

/// A message of ours in a log. `start_ns` is the run's start on the monotonic clock.
LogEvent cycle_of(std::int64_t n, std::int64_t start_ns, const std::string& prefix = "ABS_") {
  telemetry_t m{};
  m.cycle = m.sequence = n;
  m.stamp_ns = start_ns + n * 1'000'000;
  m.time_s = static_cast<double>(n) * 1e-3;
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  return {.channel = prefix + "TELEMETRY", .data = {bytes.begin(), bytes.end()}};
}

LogEvent description_of(std::int64_t sequence, std::int64_t stamp_ns, const std::string& prefix = "ABS_") {
  experiment_t m{};
  m.sequence = sequence;
  m.stamp_ns = stamp_ns;
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  return {.channel = prefix + "EXPERIMENT", .data = {bytes.begin(), bytes.end()}};
}

LogEvent other(const std::string& channel) { return {.channel = channel, .data = {1, 2, 3}}; }

LogEvent changed(LogEvent event, std::size_t at) {
  event.data[at] ^= 0x40U;
  return event;
}

/// The numbers of the runs of these events.
std::vector<std::size_t> runs_of(const std::vector<LogEvent>& events) {
  RunSeparator separator;
  std::vector<std::size_t> runs;
  for (const LogEvent& event : events) runs.push_back(separator.run_of(event));
  return runs;
}

TEST_CASE("runs of a recording are told apart") {
  using Runs = std::vector<std::size_t>;
  const std::int64_t later = 77'000'000'000;
  SECTION("one after the other, in virtual time, which begins at the same instant again") {
    CHECK(runs_of({description_of(0, 0), cycle_of(0, 0), cycle_of(1, 0), description_of(1, 1'000'000),
                   description_of(0, 0), cycle_of(0, 0), cycle_of(1, 0), cycle_of(2, 0)}) ==
          Runs{0, 0, 0, 0, 1, 1, 1, 1});
    CHECK(runs_of({cycle_of(0, 0), cycle_of(1, 0), cycle_of(0, 0), cycle_of(1, 0)}) == Runs{0, 0, 1, 1});
  }
  SECTION("a recording that begins and goes on in the middle of runs") {
    CHECK(runs_of({cycle_of(700, 0), cycle_of(701, 0), cycle_of(900, later), cycle_of(901, later)}) ==
          Runs{0, 0, 1, 1});
    CHECK(runs_of({cycle_of(700, 0), cycle_of(701, 0), cycle_of(900, 0), description_of(3, 950'000'000)}) ==
          Runs{0, 0, 0, 0});
    CHECK(runs_of({description_of(3, 950'000'000), cycle_of(951, 0)}) == Runs{0, 0});
    CHECK(runs_of({cycle_of(700, 0), description_of(0, later), cycle_of(0, later)}) == Runs{0, 1, 1});
  }
  SECTION("several rigs at once, by their prefixes and even without") {
    CHECK(runs_of({description_of(0, 0, "A_"), cycle_of(0, 0, "A_"), description_of(0, 5, "B_"), cycle_of(0, 5, "B_"),
                   cycle_of(1, 0, "A_"), other("B_EVENT"), other("A_EVENT"), other("CAMERA")}) ==
          Runs{0, 0, 1, 1, 0, 1, 0, 1});
    CHECK(runs_of({cycle_of(500, 0), cycle_of(3, later), cycle_of(501, 0), cycle_of(4, later), cycle_of(502, 0)}) ==
          Runs{0, 1, 0, 1, 0});
  }
  SECTION("one damaged number, a late message and a message that comes twice begin no run") {
    for (const std::size_t at : {9U, 17U, 25U, 33U}) {  // in stamp, sequence, cycle, time
      CHECK(runs_of({cycle_of(0, 0), cycle_of(1, 0), changed(cycle_of(2, 0), at), cycle_of(3, 0), cycle_of(4, 0)}) ==
            Runs{0, 0, 0, 0, 0});
    }
    CHECK(runs_of({cycle_of(5, 0), cycle_of(7, 0), cycle_of(6, 0), cycle_of(7, 0), cycle_of(8, 0)}) ==
          Runs{0, 0, 0, 0, 0});
  }
  SECTION("without a run everything is run 0") { CHECK(runs_of({other("A"), other("")}) == Runs{0, 0}); }
}

TEST_CASE("a name chooses one of the runs of a recording") {
  using Catch::Matchers::Contains;
  const abs_hil::test::TemporaryFolder scratch;
  put(scratch / "a#3", "");
  CHECK(NamedRecording("x.lcmlog#2").path == "x.lcmlog");
  CHECK(NamedRecording("x.lcmlog#2").run == 2);
  for (const std::string& plain : {std::string("x"), std::string("x#"), std::string("x#0"), std::string("x#-1"),
                                   std::string("x#b"), (scratch / "a#3").string()}) {
    CHECK(NamedRecording(plain).path == plain);
    CHECK(NamedRecording(plain).run == 0);
  }
  CHECK(chosen_run(NamedRecording("x"), 0) == 0);
  CHECK(chosen_run(NamedRecording("x"), 1) == 0);
  CHECK(chosen_run(NamedRecording("x#1"), 1) == 0);
  CHECK(chosen_run(NamedRecording("x#3"), 3) == 2);
  CHECK_THROWS_WITH(
      chosen_run(NamedRecording("x"), 2),
      Contains("holds 2 runs: give 'x#1' for the first, 'x#2' for the second;") && Contains("log info x"));
  CHECK_THROWS_WITH(chosen_run(NamedRecording("x#4"), 3), Contains("has no run 4, it holds 3"));
}

}  // namespace
}  // namespace abs_hil::telemetry
