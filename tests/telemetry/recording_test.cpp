#include "telemetry/recording.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>

#include "catch.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/log_outlet.hpp"
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

/// A log with all kinds of messages, and a CSV of the same run.
void record(const fs::path& log_path, const fs::path& csv_path, std::uint64_t cycles = 1200) {
  LogOutlet log(log_path, 1'000'000);
  CsvSink csv(csv_path);
  MessageStream stream({}, {"paper", "adaptive", "a, \"plant\"\nof two lines", "sim", R"({"a":{"b":[1,"x"]}})", "0"},
                       {});
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
    csv.consume(r, 0.1 * static_cast<double>(n));
  }
  stream.answer_command(rig::Reason::none, "quoted \"text\", with comma", 1.0);
  stream.finish();
  csv.finish();
}

TEST_CASE("event log to CSV and back gives the same bytes") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
  const ConversionCounts there = log_to_csv(scratch / "run.lcmlog", scratch / "made.csv");
  CHECK(there.raw == 0);
  CHECK(fs::exists(scratch / "made.ABS_EVENT.csv"));
  const ConversionCounts back = csv_to_log(scratch / "made.csv", scratch / "back.lcmlog");
  CHECK(there.events == back.events);
  CHECK(content(scratch / "run.lcmlog") == content(scratch / "back.lcmlog"));
}

/// The fields of a row whose columns are fields of telemetry_t, too; the columns after them tell of samples.
std::string told_by_telemetry(const std::string& row) {
  constexpr std::size_t columns_of_samples = 3;
  std::size_t end = row.size();
  for (std::size_t n = 0; n < columns_of_samples; ++n) end = row.rfind(',', end - 1);
  return row.substr(0, end);
}

TEST_CASE("the CSV begins with the fixed columns of --csv, and they hold the same text") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
  log_to_csv(scratch / "run.lcmlog", scratch / "made.csv");
  std::ifstream made(scratch / "made.csv"), own(scratch / "own.csv");
  std::string made_line, own_line;
  int rows = 0;
  while (std::getline(own, own_line)) {
    REQUIRE(std::getline(made, made_line));
    // A NaN keeps its sign here, because the conversion back must give it again.
    for (std::size_t at; (at = made_line.find("-NaN")) != std::string::npos;) made_line.erase(at, 1);
    if (rows == 0) CHECK(own_line == told_by_telemetry(own_line) + ",sample_valid,sample_time_s,wheels_apart");
    CHECK(made_line.starts_with(told_by_telemetry(own_line) + ','));
    ++rows;
  }
  CHECK(rows == 1201);
}

TEST_CASE("unknown types and damaged messages are converted without loss") {
  const abs_hil::test::TemporaryFolder scratch;
  {
    EventLogWriter log(scratch / "odd.lcmlog");
    telemetry_t m{};
    m.motor_enable = 5;  // not a valid flag, but the sender sent it
    m.phase = 3;
    EncodeBuffer buffer;
    const auto bytes = buffer.encode(m);
    log.write({.number = 0, .timestamp_us = 5, .channel = "OTHER", .data = {1, 2, 3, 0xFF}});
    log.write({.number = 4, .timestamp_us = -5, .channel = "ABS_TELEMETRY", .data = {bytes.begin(), bytes.end()}});
    log.write({.number = 5, .timestamp_us = 6, .channel = "ABS_TELEMETRY", .data = {bytes.begin(), bytes.end() - 1}});
    log.write({.number = 9, .timestamp_us = 7, .channel = "EMPTY", .data = {}});
    m.phase = 77;
    const auto odd_phase = buffer.encode(m);
    log.write(
        {.number = 10, .timestamp_us = 8, .channel = "ABS_TELEMETRY", .data = {odd_phase.begin(), odd_phase.end()}});
    m.theta_N = std::bit_cast<double>(std::uint64_t{0x7FF8'0000'0000'1234});  // a NaN with a payload
    const auto odd_nan = buffer.encode(m);
    log.write({.number = 11, .timestamp_us = 9, .channel = "rig2/TELEMETRY", .data = {odd_nan.begin(), odd_nan.end()}});
    log.finish();
  }
  const ConversionCounts counts = log_to_csv(scratch / "odd.lcmlog", scratch / "odd.csv");
  CHECK(counts.events == 6);
  CHECK(counts.raw == 5);
  csv_to_log(scratch / "odd.csv", scratch / "back.lcmlog");
  CHECK(content(scratch / "odd.lcmlog") == content(scratch / "back.lcmlog"));
}

TEST_CASE("a log with another number of rigs keeps each channel in a file of its own") {
  const abs_hil::test::TemporaryFolder scratch;
  telemetry_t m{};
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  const std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  EventLogWriter log(scratch / "two.lcmlog");
  for (int n = 0; n < 6; ++n) log.write({n, n, n % 2 == 0 ? "A_TELEMETRY" : "B/TELEMETRY", data});
  log.finish();
  CHECK(log_to_csv(scratch / "two.lcmlog", scratch / "two.csv").raw == 0);
  CHECK(fs::exists(scratch / "two.B_TELEMETRY.csv"));
  csv_to_log(scratch / "two.csv", scratch / "back.lcmlog");
  CHECK(content(scratch / "two.lcmlog") == content(scratch / "back.lcmlog"));
}

TEST_CASE("channels whose names make the same file name get files of their own") {
  const abs_hil::test::TemporaryFolder scratch;
  telemetry_t m{};
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  const std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  EventLogWriter log(scratch / "many.lcmlog");
  std::int64_t n = 0;
  for (const char* channel : {"MAIN", "A/B/C", "A_B/C", "A/B_C", "A_B_C"}) {
    log.write({n, n, channel, data});
    ++n;
  }
  log.finish();
  CHECK(log_to_csv(scratch / "many.lcmlog", scratch / "many.csv").events == 5);
  CHECK(csv_to_log(scratch / "many.csv", scratch / "back.lcmlog").events == 5);
  CHECK(content(scratch / "many.lcmlog") == content(scratch / "back.lcmlog"));
}

TEST_CASE("a log that is overwritten at any place is an error that names the place") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
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
  record(scratch / "run.lcmlog", scratch / "own.csv", 10);
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

TEST_CASE("a log damaged anywhere is converted whole, up to its cut, or leaves the older file as it was") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv", 12);
  const std::string whole = content(scratch / "run.lcmlog");
  int refused = 0, converted = 0, cut = 0;
  const auto convert = [&](const std::string& bytes) {
    const fs::path folder = scratch / "made";
    fs::create_directory(folder);
    put(folder / "made.csv", "older");
    put(scratch / "x.lcmlog", bytes);
    ConversionCounts counts;
    try {
      counts = log_to_csv(scratch / "x.lcmlog", folder / "made.csv");
    } catch (const RecordingError&) {
      ++refused;
      REQUIRE(content(folder / "made.csv") == "older");
      REQUIRE(std::distance(fs::directory_iterator(folder), fs::directory_iterator()) == 1);
      return;
    }
    csv_to_log(folder / "made.csv", scratch / "back.lcmlog");
    const std::string back = content(scratch / "back.lcmlog");
    REQUIRE(back == bytes.substr(0, back.size()));
    REQUIRE((back.size() == bytes.size()) == counts.cut.empty());
    // Only one message may be missing.
    REQUIRE(bytes.find("\xED\xA1\xDA\x01", back.size() + 1) == std::string::npos);
    ++(counts.cut.empty() ? converted : cut);
    fs::remove_all(folder);
  };
  for (std::size_t at = 0; at < whole.size(); at += 17) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at / 17 % 8)));
    convert(flipped);
    if (at % 3 == 0) convert(whole.substr(0, at));
  }
  CHECK(refused > 10);
  CHECK(converted > 10);
  CHECK(cut > 10);
}

TEST_CASE("a full disk leaves the older file of a conversion as it was") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
  const fs::path folder = scratch / "made";
  fs::create_directory(folder);
  put(folder / "made.csv", "older");
  put(scratch / "older.lcmlog", "older");
  rlimit limit{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &limit) == 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 100'000, .rlim_max = limit.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  CHECK_THROWS_AS(log_to_csv(scratch / "run.lcmlog", folder / "made.csv"), files::FileError);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &limit) == 0);
  CHECK(content(folder / "made.csv") == "older");
  log_to_csv(scratch / "run.lcmlog", scratch / "good.csv");
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  CHECK_THROWS_AS(csv_to_log(scratch / "good.csv", scratch / "older.lcmlog"), files::FileError);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &limit) == 0);
  std::signal(SIGXFSZ, handler);
  CHECK(content(scratch / "older.lcmlog") == "older");
}

TEST_CASE("CSV that is not a recording is refused with its name") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
  using Catch::Matchers::Contains;
  CHECK_THROWS_WITH(csv_to_log(scratch / "own.csv", scratch / "back.lcmlog"), Contains("encoder counts"));
  log_to_csv(scratch / "run.lcmlog", scratch / "made.csv");
  CHECK_THROWS_WITH(log_to_csv(scratch / "run.lcmlog", scratch / "made.csv"), Contains("already exists"));
  std::string text = content(scratch / "made.csv");
  const std::size_t row = text.find('\n') + 1;
  put(scratch / "bad.csv", text.substr(0, row) + "abc" + text.substr(row));
  CHECK_THROWS_WITH(csv_to_log(scratch / "bad.csv", scratch / "back.lcmlog"), Contains("row 2") && Contains("time_s"));
  put(scratch / "few.csv", text.substr(0, row) + "1,2\n");
  CHECK_THROWS_WITH(csv_to_log(scratch / "few.csv", scratch / "back.lcmlog"), Contains("2 fields"));
}

}  // namespace
}  // namespace abs_hil::telemetry
