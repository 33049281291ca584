#include "study/comparison.hpp"

#include "catch.hpp"
#include "paper_plan.hpp"
#include "study/comparison_table.hpp"

using namespace abs_hil::study;
using namespace abs_hil::study::test;
using Catch::Matchers::Contains;

TEST_CASE("the report is the same, byte for byte, with any number of threads") {
  ComparisonPlan plan = paper_plan({"adaptive", "nominal", "locked"}, 6);
  const Comparison once = compare(plan);
  const std::string text = to_text(tabulate(plan, once));
  const std::string runs = runs_csv(plan, once);
  for (const std::size_t threads : {2U, 7U}) {
    plan.threads = threads;
    const Comparison again = compare(plan);
    CHECK(to_text(tabulate(plan, again)) == text);
    CHECK(runs_csv(plan, again) == runs);
  }
  plan.seed = 4;
  CHECK(to_text(tabulate(plan, compare(plan))) != text);
}

TEST_CASE("every controller gets the same plants") {
  // The error of a known estimate shows the true theta of run k, which must not depend on the controller.
  ComparisonPlan plan = paper_plan({"nominal", "adaptive"}, 4);
  const Comparison both = compare(plan);
  plan.controllers = {"adaptive"};
  const Comparison alone = compare(plan);
  for (std::size_t k = 0; k < plan.repeat; ++k) {
    const double factor = draw(plan.variation, plan.seed, k).theta;
    CHECK(both.results[0][k].metrics.theta_error_final == Catch::Detail::Approx(1.0 / factor - 1.0));
    CHECK(both.results[1][k].metrics.stop_time_s == alone.results[0][k].metrics.stop_time_s);
    CHECK(both.results[1][k].metrics.theta_error_rms == alone.results[0][k].metrics.theta_error_rms);
  }
}

TEST_CASE("without variation every run is the same") {
  ComparisonPlan plan = paper_plan({"adaptive"}, 3);
  plan.variation = {};
  const Comparison comparison = compare(plan);
  const auto column = tabulate(plan, comparison).columns.front();
  CHECK(column.means.front().standard_deviation == 0.0);
  CHECK(comparison.results[0][0].metrics.stop_distance_m == comparison.results[0][2].metrics.stop_distance_m);
}

TEST_CASE("an invalid plan is refused before any run") {
  CHECK_THROWS_WITH(compare(paper_plan({"adaptive", "nope"}, 1)), Contains("nope"));
  CHECK_THROWS_WITH(compare(paper_plan({"adaptive", "adaptive"}, 1)), Contains("adaptive") && Contains("twice"));
  CHECK_THROWS_WITH(compare(paper_plan({}, 1)), Contains("--controllers"));
  CHECK_THROWS_WITH(compare(paper_plan({"adaptive"}, 0)), Contains("--repeat"));
}

TEST_CASE("every run is reported as done, once") {
  ComparisonPlan plan = paper_plan({"adaptive", "locked"}, 3);
  std::vector<std::size_t> seen;
  static_cast<void>(compare(plan, [&seen](std::size_t done) { seen.push_back(done); }));
  CHECK(seen == std::vector<std::size_t>{1, 2, 3, 4, 5, 6});
}
