// Comparing controllers on the same varied plants.
#include "study/comparison.hpp"

#include "catch.hpp"
#include "paper_plan.hpp"

using namespace abs_hil::study;
using namespace abs_hil::study::test;
using Catch::Matchers::Contains;

TEST_CASE("the report is the same, byte for byte, with any number of threads") {
  const Study study = paper_study({"adaptive", "nominal", "locked"}, 6);
  const RunsByController once = run_by_controller(study, 1);
  const std::string text = to_text(tabulate(study, once));
  const std::string runs = runs_csv(study, once);
  for (const std::size_t threads : {2U, 7U}) {
    const RunsByController again = run_by_controller(study, threads);
    CHECK(to_text(tabulate(study, again)) == text);
    CHECK(runs_csv(study, again) == runs);
  }
  const Study other = paper_study({"adaptive", "nominal", "locked"}, 6, Variation::standard(), 4);
  CHECK(to_text(tabulate(other, run_by_controller(other, 1))) != text);
}

TEST_CASE("every controller gets the same plants") {
  // The error of a known estimate shows the true theta of run k, which must not depend on the controller.
  const Study study = paper_study({"nominal", "adaptive"}, 4);
  const RunsByController both = run_by_controller(study, 1);
  const RunsByController alone = run_by_controller(paper_study({"adaptive"}, 4), 1);
  for (std::size_t k = 0; k < 4; ++k) {
    const double factor = draw(study.script().repeat.variation, study.script().repeat.seed, k).theta;
    CHECK(both[0][k].metrics.theta_error_final == Catch::Detail::Approx(1.0 / factor - 1.0));
    CHECK(both[1][k].metrics.stop_time_s == alone[0][k].metrics.stop_time_s);
    CHECK(both[1][k].metrics.theta_error_rms == alone[0][k].metrics.theta_error_rms);
  }
}

TEST_CASE("without variation every run is the same") {
  const Study study = paper_study({"adaptive"}, 3, {});
  const RunsByController runs = run_by_controller(study, 1);
  CHECK(tabulate(study, runs).columns.front().means.front().standard_deviation == 0.0);
  CHECK(runs[0][0].metrics.stop_distance_m == runs[0][2].metrics.stop_distance_m);
}

TEST_CASE("an invalid comparison is refused before any run") {
  CHECK_THROWS_WITH(paper_study({"adaptive", "nope"}, 1), Contains("nope"));
  CHECK_THROWS_WITH(paper_study({"adaptive", "adaptive"}, 1), Contains("adaptive") && Contains("twice"));
  CHECK_THROWS_WITH(paper_study({}, 1), Contains("--controllers"));
  CHECK_THROWS_WITH(paper_study({"adaptive"}, 0), Contains("--repeat"));
}

TEST_CASE("every run is reported as done, once") {
  std::vector<std::size_t> seen;
  static_cast<void>(run_by_controller(paper_study({"adaptive", "locked"}, 3), 1,
                                      [&seen](std::size_t done) { seen.push_back(done); }));
  CHECK(seen == std::vector<std::size_t>{1, 2, 3, 4, 5, 6});
}
