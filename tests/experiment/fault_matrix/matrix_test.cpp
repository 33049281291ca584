// Every signal x every kind of fault x every phase, on the virtual clock.

#include "matrix.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;

namespace {

const std::vector<MatrixCase>& all_cases() {
  static const std::vector<MatrixCase> cases = [] {
    std::vector<MatrixCase> run;
    for (const driver::Injection& injection : all_injections()) run.push_back(run_case(injection));
    return run;
  }();
  return cases;
}

/// How much longer the way to a stop may get in a run that goes on.
constexpr double longest_degraded = 1.40;
constexpr double longest_undisturbed = 1.005;

bool touches_braking(const driver::Injection& injection) {
  using enum driver::InjectionSignal;
  return injection.signal == encoder_upper || injection.signal == encoder_lower || injection.signal == encoders ||
         injection.signal == stamp || injection.signal == brake_pwm || injection.signal == write;
}

}  // namespace

TEST_CASE("every fault in every phase ends safe, recorded to the last cycle, for the right reason and in time") {
  for (const MatrixCase& c : all_cases()) {
    const Expectation expectation = expected(c.injection);
    CAPTURE(driver::to_text(c.injection), static_cast<int>(c.reason), c.reaction_s);
    CHECK(c.safe);
    CHECK(c.complete);
    if (c.survived()) {
      CHECK(expectation.may_survive);
    } else {
      CHECK(std::count(expectation.reasons.begin(), expectation.reasons.end(), c.reason) > 0);
      CHECK(c.reaction_s <= expectation.bound_s);
    }
  }
}

TEST_CASE("a run that goes on in spite of a fault keeps within the stated degradation") {
  const double nominal_m = metrics_without_fault().stop_distance_m;
  for (const MatrixCase& c : all_cases()) {
    if (!c.survived()) continue;
    CAPTURE(driver::to_text(c.injection));
    const bool none = c.injection.kind == driver::InjectionKind::ok || !touches_braking(c.injection);
    CHECK(c.metrics.stop_distance_m < nominal_m * (none ? longest_undisturbed : longest_degraded));
  }
}

TEST_CASE("docs/fault-matrix.md is what the runs give") {
  const std::string text = page(all_cases());
  if (const char* file = std::getenv("ABS_HIL_WRITE_FAULT_MATRIX"); file != nullptr) {
    std::ofstream(file) << text;
    return;
  }
  std::ifstream stored(ABS_HIL_DOCS "/fault-matrix.md");
  std::stringstream content;
  content << stored.rdbuf();
  INFO("run scripts/fault_matrix.sh and look at what it changes");
  CHECK((content.str() == text));
}
