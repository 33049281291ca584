// From an event log to the CSV of the same run.

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>

#include "catch.hpp"
#include "files/result_file.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
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
    csv.consume(r, 0.1 * static_cast<double>(n));
  }
  stream.answer_command(rig::Reason::none, "quoted \"text\", with comma", 1.0);
  stream.finish();
  csv.finish();
}

std::vector<std::string> lines_of(const fs::path& path) {
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

TEST_CASE("the CSV of a log begins with the whole rows of --csv, and every other channel has its file") {
  const abs_hil::test::TemporaryFolder scratch;
  record(scratch / "run.lcmlog", scratch / "own.csv");
  const ConversionCounts counts = log_to_csv(scratch / "run.lcmlog", scratch / "made.csv");
  CHECK(counts.raw == 0);
  CHECK(counts.lacks.empty());
  const std::vector<std::string> own = lines_of(scratch / "own.csv"), made = lines_of(scratch / "made.csv");
  REQUIRE(own.size() == 1201);
  REQUIRE(made.size() == own.size());
  for (std::size_t n = 0; n < own.size(); ++n) REQUIRE(made[n].starts_with(own[n] + ','));
  CHECK(made[0].ends_with(
      ",measured_ns,phase_index,upper_edge_age_ns,lower_edge_age_ns,log_event,log_time_us,channel,type"));
  CHECK(made[8].find(",1007000040,0,") != std::string::npos);  // a board's own time
  const std::vector<std::string> events = lines_of(scratch / "made.ABS_EVENT.csv");
  CHECK(events.back().find("\"quoted \"\"text\"\", with comma\"") != std::string::npos);
  CHECK(counts.events == 1200 + lines_of(scratch / "made.ABS_EXPERIMENT.csv").size() + events.size() +
                             lines_of(scratch / "made.ABS_STATUS.csv").size() - 4 /* lines of "two lines", headers */);
}

TEST_CASE("names of phases and signals follow the columns of --csv as they do there") {
  const abs_hil::test::TemporaryFolder scratch;
  const rig::RunNames names{.phases = {{rig::Phase::brake, "brake-low"}}, .signals = {"I_m", "zeta_N"}};
  {
    LogOutlet log(scratch / "run.lcmlog", 0);
    CsvSink csv(scratch / "own.csv", 0, names);
    ExperimentInfo info{};
    info.names = names;
    MessageStream stream({}, info, {});
    stream.add(log);
    for (std::uint64_t n = 0; n < 10; ++n) {
      rig::CycleRecord r = test::sample_record(n);
      r.control.signals = {0.5, static_cast<double>(n)};
      stream.consume(r, 0.1);
      csv.consume(r, 0.1);
    }
    stream.finish();
    csv.finish();
  }
  log_to_csv(scratch / "run.lcmlog", scratch / "made.csv");
  const std::vector<std::string> own = lines_of(scratch / "own.csv"), made = lines_of(scratch / "made.csv");
  REQUIRE(made.size() == 11);
  for (std::size_t n = 0; n < own.size(); ++n) CHECK(made[n].starts_with(own[n] + ','));
}

TEST_CASE("unknown types and damaged messages are kept as hexadecimal digits") {
  const abs_hil::test::TemporaryFolder scratch;
  telemetry_t m{};
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  std::string log;
  append_event(log, 0, 5, "OTHER", std::vector<std::uint8_t>{1, 2, 3, 0xFF});
  append_event(log, 4, -5, "ABS_TELEMETRY", bytes);
  append_event(log, 5, 6, "ABS_TELEMETRY", bytes.first(bytes.size() - 1));
  append_event(log, 9, 7, "EMPTY", {});
  files::write_result(scratch / "odd.lcmlog", "event log", log);
  const ConversionCounts counts = log_to_csv(scratch / "odd.lcmlog", scratch / "odd.csv");
  CHECK(counts.events == 4);
  CHECK(counts.raw == 3);
  CHECK(lines_of(scratch / "odd.csv").size() == 2);
  const std::vector<std::string> raw = lines_of(scratch / "odd.raw.csv");
  REQUIRE(raw.size() == 4);
  CHECK(raw[0] == "data_hex,log_event,log_time_us,channel,type");
  CHECK(raw[1] == "010203ff,0,5,OTHER,raw");
  CHECK(raw[3] == ",9,7,EMPTY,raw");
}

TEST_CASE("a log with another number of rigs keeps each channel in a file of its own") {
  const abs_hil::test::TemporaryFolder scratch;
  telemetry_t m{};
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  std::string log;
  for (int n = 0; n < 6; ++n) append_event(log, n, n, n % 2 == 0 ? "A_TELEMETRY" : "B/TELEMETRY", bytes);
  files::write_result(scratch / "two.lcmlog", "event log", log);
  CHECK(log_to_csv(scratch / "two.lcmlog", scratch / "two.csv").raw == 0);
  CHECK(fs::exists(scratch / "two.B_TELEMETRY.csv"));
  CHECK(lines_of(scratch / "two.B_TELEMETRY.csv").size() == 4);
  CHECK(lines_of(scratch / "two.csv").size() == 4);
}

TEST_CASE("channels whose names make the same file name get files of their own") {
  const abs_hil::test::TemporaryFolder scratch;
  telemetry_t m{};
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(m);
  std::string log;
  std::int64_t n = 0;
  for (const char* channel : {"MAIN", "A/B/C", "A_B/C", "A/B_C", "A_B_C"}) {
    append_event(log, n, n, channel, bytes);
    ++n;
  }
  files::write_result(scratch / "many.lcmlog", "event log", log);
  CHECK(log_to_csv(scratch / "many.lcmlog", scratch / "many.csv").events == 5);
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(scratch / "many.csv").parent_path())) {
    if (entry.path().extension() != ".csv") continue;
    ++files;
    CHECK(lines_of(entry.path()).size() == 2);
  }
  CHECK(files == 5);
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
    // Every event has a row somewhere.
    std::size_t rows = 0, files = 0;
    for (const auto& entry : fs::directory_iterator(folder)) {
      ++files;
      const std::string text = content(entry.path());
      for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1)) ++rows;
    }
    REQUIRE(rows >= counts.events + files);
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
  rlimit limit{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &limit) == 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{.rlim_cur = 100'000, .rlim_max = limit.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  CHECK_THROWS_AS(log_to_csv(scratch / "run.lcmlog", folder / "made.csv"), files::FileError);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &limit) == 0);
  CHECK(content(folder / "made.csv") == "older");
  std::signal(SIGXFSZ, handler);
}

}  // namespace
}  // namespace abs_hil::telemetry
