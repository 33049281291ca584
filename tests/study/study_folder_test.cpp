// Results of studies: the same bytes in whatever parts, order and threads they are computed.
#include "study/study_folder.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "study/compute.hpp"
#include "study/paper_plan.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

Study small_study(const std::string& first_line = "") {
  return {parse_study(first_line + R"(
chunk = 4
[design]
kind = "latin-hypercube"
points = 11
[factors]
plant.theta_N = { from = 15, to = 30 }
experiment.end_speed_m_s = [5.0]
)",
                      "test.toml"),
          {{.plant = "paper-table1", .experiment = "paper", .settings = study::test::paper_settings()}}};
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  REQUIRE(file);
  return text.str();
}

std::string results_of(const StudyFolder& folder) { return bytes_of(folder.path() / file::results); }

/// Computes a shard and returns its number of chunks.
std::size_t compute_shard(const Study& study, const StudyFolder& folder, Shard shard, std::size_t threads = 1) {
  const std::size_t chunks = missing_chunks(folder, shard).size();
  static_cast<void>(compute(study, folder, shard, threads, {}));
  return chunks;
}

}  // namespace

TEST_CASE("shards in any number, order and threads, in one folder or several, give the bytes of one process") {
  const Study study = small_study();
  const StudyFacts facts = facts_of(study, "small");
  const abs_hil::test::TemporaryFolder scratch;
  const StudyFolder whole(scratch / "whole", facts);
  CHECK(compute_shard(study, whole, {}) == 3);
  whole.merge({});
  const std::string expected = results_of(whole);

  const StudyFolder shared(scratch / "shared", facts);
  CHECK(compute_shard(study, shared, {.number = 3, .of = 3}, 2) == 1);
  CHECK(compute_shard(study, shared, {.number = 1, .of = 2}, 3) == 1);  // chunks 0 and 2, and 2 is there
  CHECK_THROWS_WITH(shared.merge({}), Contains("1 of 3 chunks are missing: 1;"));
  CHECK_FALSE(shared.complete());
  CHECK(compute_shard(study, shared, {.number = 1, .of = 2}) == 0);  // repeated
  CHECK(compute_shard(study, shared, {.number = 2, .of = 2}) == 1);
  shared.merge({});
  CHECK(results_of(shared) == expected);
  CHECK_FALSE(fs::exists(shared.path() / file::parts));
  CHECK(missing_chunks(shared, {}).empty());
  shared.merge({});  // again: no harm
  CHECK(results_of(shared) == expected);

  const StudyFolder one(scratch / "one", facts);
  const StudyFolder two(scratch / "two", facts);
  compute_shard(study, one, {.number = 1, .of = 2});
  compute_shard(study, two, {});
  one.merge({two});
  CHECK(results_of(one) == expected);
}

TEST_CASE("results hold a row for every run, in order, and say which study they are of") {
  const Study study = small_study();
  const abs_hil::test::TemporaryFolder scratch;
  const StudyFolder folder(scratch / "whole", facts_of(study, "small"));
  compute_shard(study, folder, {});
  // Chunks are members of their own.
  const GzipMember first = read_gzip_member(bytes_of(folder.path() / file::parts / "00000000.csv.gz"));
  CHECK(first.note == "abs_hil study " + folder.facts().identity + " chunk 0");
  CHECK(std::count(first.content.begin(), first.content.end(), '\n') == 4);
  const RunResult alone = simulate(study.contenders(0)[0].settings, study.cases()[0].settings.plant, 1);
  CHECK(alone.stopped());
  CHECK(result_row(study, 7, {.run = alone}).starts_with("7,paper-table1,paper,adaptive,7,0,"));
  CHECK_THAT(result_row(study, 0, {.refusal = "so, \"no\""}), Contains(R"(,refused,"so, ""no""",nan,)"));
}

TEST_CASE("a chunk that is damaged, cut off or another's stops the merge, which names the file, and is computed anew") {
  const Study study = small_study();
  const abs_hil::test::TemporaryFolder scratch;
  const StudyFolder folder(scratch / "whole", facts_of(study, "small"));
  compute_shard(study, folder, {});
  const fs::path chunk = folder.path() / file::parts / "00000001.csv.gz";
  const std::string good = bytes_of(chunk);
  const auto write = [&chunk](const std::string& bytes) { std::ofstream(chunk, std::ios::binary) << bytes; };
  std::string flipped = good;
  flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 1);
  const GzipMember member = read_gzip_member(good);
  const std::string fewer = member.content.substr(0, member.content.rfind("\n7,") + 1);
  for (const std::string& bad :
       {flipped, good.substr(0, good.size() - 3), std::string(), good + good, gzip_member(member.content, "another"),
        gzip_member(fewer, member.note), gzip_member("9" + member.content, member.note),
        bytes_of(folder.path() / file::parts / "00000002.csv.gz")}) {
    write(bad);
    CHECK_THROWS_WITH(folder.merge({}), Contains("00000001.csv.gz") && Contains("run the study again"));
    CHECK(missing_chunks(folder, {}) == std::vector<std::uint64_t>{1});
    CHECK(missing_chunks(folder, {.number = 1, .of = 2}).empty());
    CHECK_FALSE(folder.complete());
  }
  const Tally tally = compute(study, folder, {}, 1, {});
  CHECK(tally.damaged == std::vector<std::uint64_t>{1});
  CHECK(tally.runs == 4);
  CHECK(bytes_of(chunk) == good);
  CHECK(compute(study, folder, {}, 1, {}).damaged.empty());
  folder.merge({});
  CHECK(folder.complete());
}

TEST_CASE("a complete study whose files have changed is refused by the name of the file") {
  const Study study = small_study();
  const StudyFacts facts = facts_of(study, "small");
  const abs_hil::test::TemporaryFolder scratch;
  const fs::path path = scratch / "whole";
  compute_shard(study, StudyFolder(path, facts), {});
  StudyFolder(path).merge({});
  CHECK_NOTHROW(StudyFolder(path, facts));
  for (const std::string_view name : {file::results, file::text}) {
    const std::string good = bytes_of(path / name);
    std::string bad = good;
    bad[bad.size() / 2] = static_cast<char>(bad[bad.size() / 2] ^ 1);
    std::ofstream(path / name, std::ios::binary) << bad;
    CHECK_THROWS_WITH(StudyFolder(path, facts), Contains(std::string(name)) && Contains("SHA256SUMS"));
    CHECK_THROWS_AS(StudyFolder(path), config::ConfigError);
    std::ofstream(path / name, std::ios::binary) << good;
  }
  CHECK(StudyFolder(path).complete());
}

TEST_CASE("a folder takes one study of one program") {
  const abs_hil::test::TemporaryFolder scratch;
  const Study study = small_study();
  const StudyFacts facts = facts_of(study, "small");
  const StudyFolder folder(scratch / "a", facts);
  CHECK_NOTHROW(StudyFolder(scratch / "a", facts));
  CHECK_THROWS_WITH(StudyFolder(scratch / "a", facts_of(small_study("# other\n"), "small")), Contains("another study"));
  StudyFacts newer = facts;
  newer.program = "abs_hil 9";
  newer.identity = "9";
  CHECK_THROWS_WITH(StudyFolder(scratch / "a", newer), Contains("another program"));
  fs::create_directory(scratch / "b");
  std::ofstream((scratch / "b") / "thesis.tex") << "x";
  CHECK_THROWS_AS(StudyFolder(scratch / "b", facts), config::ConfigError);
  CHECK_THROWS_WITH(StudyFolder(scratch / "b"), Contains("holds no study"));
  CHECK(StudyFolder(scratch / "a").facts().columns == facts.columns);
  const StudyFolder other(scratch / "c", facts_of(small_study("# other\n"), "small"));
  CHECK_THROWS_AS(folder.merge({other}), config::ConfigError);
}

TEST_CASE("lists of chunks are short") {
  CHECK(list_of({3}) == "3");
  CHECK(list_of({1, 2, 3, 7}) == "1 to 3, 7");
  CHECK(list_of({0, 2, 4, 6, 8, 10, 12, 14}) == "0, 2, 4, 6, 8, 10 and 2 more");
}
