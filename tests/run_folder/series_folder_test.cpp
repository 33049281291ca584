// Folders of series: going on after an interruption, and what is refused.
#include <fstream>

#include "catch.hpp"
#include "run_folder/run_folder.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil::run_folder;
namespace fs = std::filesystem;
using Catch::Matchers::Contains;

namespace {

using abs_hil::test::TemporaryFolder;

std::vector<SeriesEntry> three() { return {{.seed = 1}, {.seed = 2}, {.seed = 3}}; }

void do_run(SeriesFolder& series, std::size_t i, const std::string& status) {
  const RunFolder run(series.begin(i));
  run.write("run.csv", std::string_view("x"));
  run.seal();
  CHECK(series.end(i, status));
}

}  // namespace

TEST_CASE("a series of runs continues where it stopped, and keeps the files of an interrupted run") {
  const TemporaryFolder place;
  const fs::path path = place.path / "series";
  {
    SeriesFolder series(path, "id", "paper", three());
    CHECK_FALSE(series.resumed());
    do_run(series, 0, "completed");
    do_run(series, 1, "fault");
    RunFolder(series.begin(2)).write("run.csv", std::string_view("half"));
  }
  SeriesFolder series(path, "id", "paper", three());
  CHECK(series.resumed());
  CHECK(series.status(0) == "completed");
  CHECK(series.status(1) == "fault");
  CHECK_FALSE(series.done(2));
  do_run(series, 2, "completed");
  CHECK(fs::exists(path / "run-0003" / "run.csv"));
  CHECK(fs::exists(path / "run-0003.interrupted-1" / "run.csv"));
  const auto index = nlohmann::json::parse(std::ifstream(path / "series.json"));
  CHECK(index["runs"][2]["status"] == "completed");
  CHECK(index["runs"][2]["seed"] == 3);
}

TEST_CASE("a run without a complete record is repeated, and its files are kept") {
  const TemporaryFolder place;
  const fs::path path = place.path / "series";
  {
    SeriesFolder series(path, "id", "paper", three());
    RunFolder(series.begin(0)).write("run.csv", std::string_view("half"));
    CHECK_FALSE(series.end(0, "fault"));
    CHECK_FALSE(series.done(0));
    do_run(series, 1, "fault");
    do_run(series, 2, "completed");
    fs::remove(path / "run-0002" / file::checksums);
  }
  SeriesFolder series(path, "id", "paper", three());
  CHECK_FALSE(series.done(0));
  CHECK_FALSE(series.done(1));
  CHECK(series.done(2));
  do_run(series, 0, "completed");
  do_run(series, 1, "completed");
  CHECK(fs::exists(path / "run-0001.interrupted-1" / "run.csv"));
  CHECK(fs::exists(path / "run-0002.interrupted-1" / "run.csv"));
  CHECK(fs::exists(path / "run-0002" / file::checksums));
}

TEST_CASE("the index knows the status of a run before its folder is complete") {
  const TemporaryFolder place;
  const fs::path path = place.path / "series";
  SeriesFolder series(path, "id", "paper", three());
  const RunFolder run(series.begin(0));
  run.seal();
  fs::remove(path / "series.json");
  fs::create_directory(path / "series.json");
  CHECK_THROWS(series.end(0, "fault"));
  CHECK_FALSE(fs::exists(path / "run-0001"));
}

TEST_CASE("a series is not continued over a run whose files have changed") {
  const TemporaryFolder place;
  const fs::path path = place.path / "series";
  {
    SeriesFolder series(path, "id", "paper", three());
    do_run(series, 0, "completed");
  }
  CHECK(SeriesFolder(path, "id", "paper", three()).done(0));
  std::ofstream(path / "run-0001" / "run.csv") << "y";
  CHECK_THROWS_WITH(SeriesFolder(path, "id", "paper", three()), Contains("run-0001/run.csv"));
}

TEST_CASE("a folder of another series, or of anything else, is refused") {
  const TemporaryFolder place;
  const fs::path path = place.path / "series";
  SeriesFolder(path, "id", "paper", three());
  CHECK_THROWS_WITH(SeriesFolder(path, "other", "paper", three()), Contains("another series"));
  CHECK_THROWS_WITH(SeriesFolder(path, "id", "paper", {}), Contains("another series"));
  std::ofstream(path / "series.json") << "{";
  CHECK_THROWS_WITH(SeriesFolder(path, "id", "paper", three()), Contains("another series"));
  std::ofstream(path / "series.json") << R"({"identity": 1, "runs": [{}, {}, {}]})";
  CHECK_THROWS_AS(SeriesFolder(path, "id", "paper", three()), FolderError);
  std::ofstream(path / "series.json") << R"({"identity": "id", "runs": [1, null, {"status": 2}]})";
  fs::create_directory(path / "run-0003");
  CHECK_THROWS_WITH(SeriesFolder(path, "id", "paper", three()), Contains("another series"));
  std::ofstream(place.path / "mine") << "x";
  CHECK_THROWS_WITH(SeriesFolder(place.path, "id", "paper", three()), Contains("not empty"));
}
