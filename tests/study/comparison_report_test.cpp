// Tables of a comparison, from made-up runs.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "catch.hpp"
#include "paper_plan.hpp"
#include "study/comparison.hpp"

using namespace abs_hil;
using namespace abs_hil::study;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;

namespace {

RunResult run_of(double stop_time_s, double variation_Nm, double locked_s = 0.0) {
  RunResult run;
  run.metrics.stop_time_s = stop_time_s;
  run.metrics.stop_distance_m = 10.0 * stop_time_s;
  run.metrics.torque_total_variation_Nm = variation_Nm;
  run.metrics.time_locked_s = locked_s;
  run.metrics.theta_error_final = -0.02;
  return run;
}

RunResult faulty() {
  RunResult run = run_of(99.0, 99.0);
  run.fault = rig::Reason::phase_time_limit;
  return run;
}

/// Made-up runs: 2.0, 2.2, 2.4 s and 2.5, 2.7, 3.2 s, of which one more is a fault.
struct Sample {
  Study study = study::test::paper_study({"adaptive", "sliding-mode"}, 4);
  RunsByController runs{{run_of(2.0, 30), run_of(2.2, 40), run_of(2.4, 50), faulty()},
                        {run_of(2.5, 600), run_of(2.7, 800, 0.2), run_of(3.2, 1000), run_of(2.6, 700)}};
  ComparisonTable table = tabulate(study, runs);
};

std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(line);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

}  // namespace

TEST_CASE("the table holds the statistics of the runs") {
  const Sample sample;
  const ComparisonTable& table = sample.table;
  const ControllerColumn& ours = table.columns[0];
  CHECK(ours.faults == 1);
  CHECK(ours.means[0].n == 3);  // runs with a fault are left out
  CHECK_THAT(ours.means[0].mean, WithinAbs(2.2, 1e-12));
  CHECK(ours.differences.empty());
  const ControllerColumn& theirs = table.columns[1];
  CHECK(theirs.locked == 1);
  CHECK(theirs.differences[0].n == 3);  // incomplete pairs are left out
  CHECK_THAT(theirs.differences[0].mean, WithinAbs((0.5 + 0.5 + 0.8) / 3.0, 1e-12));
  REQUIRE(table.paper_ratios);
  REQUIRE(paper_metrics.front().key == "stop_time");
  CHECK_THAT(table.paper_ratios->front().mean, WithinAbs(std::cbrt(2.0 / 2.5 * 2.2 / 2.7 * 2.4 / 3.2), 1e-12));
  // Errors of either sign count alike.
  CHECK_THAT(ours.means.back().mean, WithinAbs(0.02, 1e-12));
}

TEST_CASE("the ratio is there only with both controllers of the paper") {
  const Study study = study::test::paper_study({"adaptive", "nominal"}, 1);
  CHECK_FALSE(tabulate(study, {{run_of(2, 30)}, {run_of(2, 30)}}).paper_ratios);
}

TEST_CASE("CSV and JSON contain the table's numbers with full precision") {
  const Sample sample;
  const auto json = nlohmann::json::parse(to_json(sample.table, R"({"run":{"seed":1}})"));
  CHECK(json["config"]["run"]["seed"] == 1);
  CHECK(json["repeat"] == 4);
  CHECK(json["vary"] == "parameters=0.1,theta=0.1,phase");
  CHECK(json["adaptive_over_sliding_mode"]["stop_time"]["mean"] == sample.table.paper_ratios->front().mean);
  CHECK(json["controllers"][0]["metrics"]["slip_rms"]["mean"].is_null());

  std::istringstream csv(to_csv(sample.table));
  std::string line;
  std::getline(csv, line);
  const std::vector<std::string> header = split(line, ',');
  REQUIRE(header[3] == "mean");
  std::size_t rows = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    const ControllerColumn& column = sample.table.columns[c];
    for (std::size_t m = 0; m < compared_metrics().size(); ++m, ++rows) {
      REQUIRE(std::getline(csv, line));
      const std::vector<std::string> cells = split(line, ',');
      REQUIRE(cells.size() == header.size());
      CHECK(cells[0] == sample.study.contenders(0)[c].name);
      CHECK(cells[1] == compared_metrics()[m].name);
      const auto& estimate = json["controllers"][c]["metrics"][cells[1]];
      if (std::isnan(column.means[m].mean)) continue;
      CHECK(std::stod(cells[3]) == column.means[m].mean);
      CHECK(estimate["mean"] == column.means[m].mean);
      CHECK(std::stod(cells[5]) == column.means[m].low);
      CHECK(estimate["ci95_low"] == column.means[m].low);
      CHECK(std::stod(cells[10]) == column.spreads[m].p10);
      CHECK(estimate["median"] == column.spreads[m].median);
      CHECK(std::stod(cells[12]) == column.spreads[m].p90);
    }
  }
  CHECK(rows == 2 * compared_metrics().size());
  CHECK_FALSE(std::getline(csv, line));
}

TEST_CASE("text and Markdown show the same figures, to their decimals") {
  const Sample sample;
  // s of 2.0, 2.2, 2.4 is 0.2; t(2) = 4.30265; half width 0.4968.
  for (const std::string& text : {to_text(sample.table), to_markdown(sample.table)}) {
    CHECK_THAT(text, Contains("2.200 ± 0.497 (3 runs)"));
    CHECK_THAT(text, Contains("40.0 ± 24.8 (3 runs)"));
    CHECK_THAT(text, Contains("+0.600 ± 0.430 (3 runs)"));
    CHECK_THAT(text, Contains("2.200 [2.040, 2.360]"));  // linear between 2.0, 2.2 and 2.4
    CHECK_THAT(text, Contains("the paper: 0.933"));
    CHECK_THAT(text, Contains("4 runs of each controller, seed 3, plants varied by parameters=0.1,theta=0.1,phase"));
  }
}

TEST_CASE("every row of a Markdown table has its header's number of cells") {
  const Sample sample;
  std::ptrdiff_t bars = 0;
  int rows = 0;
  for (const std::string& line : split(to_markdown(sample.table), '\n')) {
    if (line.empty() || line.front() != '|') {
      bars = 0;  // the next table begins with its own header
      continue;
    }
    const std::ptrdiff_t here = std::count(line.begin(), line.end(), '|');
    if (bars == 0) bars = here;
    CHECK(here == bars);
    ++rows;
  }
  CHECK(rows == 14 + 12 + 12);
}

TEST_CASE("a single run has no interval") {
  const Study study = study::test::paper_study({"adaptive"}, 1);
  const std::string text = to_text(tabulate(study, {{run_of(2.0, 30)}}));
  CHECK_THAT(text, Contains("2.000\n") && !Contains("±") && !Contains("Differences") && !Contains("median"));
}

TEST_CASE("the runs are listed with their results") {
  const Sample sample;
  const std::vector<std::string> lines = split(runs_csv(sample.study, sample.runs), '\n');
  REQUIRE(lines.size() == 9);
  CHECK(lines[0].rfind("controller,run,result,stop_time_s,stop_distance_m,", 0) == 0);
  CHECK(lines[1].rfind("adaptive,0,completed,2,20,", 0) == 0);
  CHECK(lines[4].rfind("adaptive,3,fault,", 0) == 0);
  CHECK(lines[5].rfind("sliding-mode,0,completed,2.5,", 0) == 0);
}
