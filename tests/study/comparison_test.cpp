// Controllers on the same varied plants.
#include "catch.hpp"
#include "paper_plan.hpp"
#include "study/compute.hpp"

using namespace abs_hil::study;
using namespace abs_hil::study::test;
using Catch::Matchers::Contains;

namespace {

std::string rows_of(const Study& study, std::size_t threads) {
  const std::vector<RunResult> runs = runs_of(study, threads);
  std::string rows;
  for (std::size_t run = 0; run < runs.size(); ++run) rows += result_row(study, run, {.run = runs[run]}, {});
  return rows;
}

}  // namespace

TEST_CASE("the rows are the same, byte for byte, with any number of threads") {
  const Study study = paper_study({"adaptive", "nominal", "locked"}, 6);
  const std::string rows = rows_of(study, 1);
  for (const std::size_t threads : {2U, 7U}) CHECK(rows_of(study, threads) == rows);
  CHECK(rows_of(paper_study({"adaptive", "nominal", "locked"}, 6, Variation::standard(), 4), 1) != rows);
}

TEST_CASE("every controller gets the same plants") {
  // The error of a known estimate shows the true theta of run k, which must not depend on the controller.
  const Study study = paper_study({"nominal", "adaptive"}, 4);
  const std::vector<RunResult> both = runs_of(study);
  const std::vector<RunResult> alone = runs_of(paper_study({"adaptive"}, 4));
  for (std::size_t k = 0; k < 4; ++k) {
    const double factor = draw(study.script().repeat.variation, study.script().repeat.seed, k).theta;
    CHECK(both[2 * k].metrics.theta_error_final == Catch::Detail::Approx(1.0 / factor - 1.0));
    CHECK(both[2 * k + 1].metrics.stop_time_s == alone[k].metrics.stop_time_s);
    CHECK(both[2 * k + 1].metrics.theta_error_rms == alone[k].metrics.theta_error_rms);
  }
}

TEST_CASE("without variation every run is the same") {
  const std::vector<RunResult> runs = runs_of(paper_study({"adaptive"}, 3, {}));
  CHECK(runs[0].metrics.stop_distance_m == runs[2].metrics.stop_distance_m);
}

TEST_CASE("an invalid comparison is refused before any run") {
  CHECK_THROWS_WITH(paper_study({"adaptive", "nope"}, 1), Contains("nope"));
  CHECK_THROWS_WITH(paper_study({"adaptive", "adaptive"}, 1), Contains("adaptive") && Contains("twice"));
  CHECK_THROWS_WITH(paper_study({}, 1), Contains("--controllers"));
  CHECK_THROWS_WITH(paper_study({"adaptive"}, 0), Contains("--repeat"));
}
