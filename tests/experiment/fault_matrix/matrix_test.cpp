// Every signal x every kind of fault x every phase, on the virtual clock, on the simulated rig and on emulated boards.

#include "matrix.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <sstream>

#include "catch.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;

namespace {

Matrix run_all(Backend backend) {
  const abs_hil::test::TemporaryFolder folder;
  Matrix matrix{.nominal_m = metrics_without_fault(backend, folder.path).stop_distance_m};
  for (const config::Injection& injection : all_injections(backend)) {
    matrix.cases.push_back(run_case(backend, injection, folder.path));
  }
  return matrix;
}

const std::array<Matrix, backends.size()>& matrices() {
  static const std::array<Matrix, backends.size()> all = [] {
    std::array<std::future<Matrix>, backends.size()> running;
    for (const Backend backend : backends) {
      running[static_cast<std::size_t>(backend)] = std::async(std::launch::async, run_all, backend);
    }
    std::array<Matrix, backends.size()> done;
    for (std::size_t i = 0; i < done.size(); ++i) done[i] = running[i].get();
    return done;
  }();
  return all;
}
const Matrix& matrix_of(Backend backend) { return matrices()[static_cast<std::size_t>(backend)]; }

/// Permitted increase of the stopping distance in a run that continues.
constexpr double longest_degraded = 1.40;
constexpr double longest_undisturbed = 1.005;

bool touches_braking(const config::Injection& injection) {
  using enum config::InjectionSignal;
  return injection.signal == encoder_upper || injection.signal == encoder_lower || injection.signal == encoders ||
         injection.signal == stamp || injection.signal == brake_pwm || injection.signal == write;
}

}  // namespace

TEST_CASE("every fault in every phase ends in the safe state in time, with the right reason and a complete record") {
  const Backend backend = GENERATE(from_range(backends));
  for (const MatrixCase& c : matrix_of(backend).cases) {
    const Expectation expectation = expected(backend, c.injection);
    CAPTURE(config::to_text(c.injection), static_cast<int>(backend), static_cast<int>(c.reason), c.reaction_s);
    CHECK(c.safe);
    CHECK(c.complete);
    CHECK(c.lost == "");
    if (c.survived()) {
      CHECK(expectation.may_survive);
    } else {
      CHECK(std::count(expectation.reasons.begin(), expectation.reasons.end(), c.reason) > 0);
      CHECK(c.reaction_s <= expectation.bound_s);
    }
  }
}

TEST_CASE("a run that continues despite a fault stays within the stated degradation") {
  const Matrix& matrix = matrix_of(GENERATE(from_range(backends)));
  for (const MatrixCase& c : matrix.cases) {
    if (!c.survived()) continue;
    CAPTURE(config::to_text(c.injection));
    const bool none = c.injection.kind == config::InjectionKind::ok || !touches_braking(c.injection);
    CHECK(c.metrics.stop_distance_m < matrix.nominal_m * (none ? longest_undisturbed : longest_degraded));
  }
}

TEST_CASE("docs/reference/fault-matrix.csv equals the result of the runs") {
  const std::string text = stored(matrices());
  if (const char* file = std::getenv("ABS_HIL_WRITE_FAULT_MATRIX"); file != nullptr) {
    std::ofstream(file) << text;
    return;
  }
  std::ifstream file(ABS_HIL_DOCS "/reference/fault-matrix.csv");
  std::stringstream content;
  content << file.rdbuf();
  INFO("run scripts/fault_matrix.sh and look at what it changes");
  CHECK((content.str() == text));
}
