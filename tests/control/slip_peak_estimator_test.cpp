// The filter that finds the peak of a tyre's curve, on curves of its own and of other families.
#include "control/slip_peak_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>
#include <vector>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

using Curve = std::function<double(double slip)>;

Curve magic(double theta_N, double B, double C) {
  return [=](double slip) { return theta_N * std::sin(C * std::atan(B * slip)); };
}

/// Slip from 0 to 0.1 in 0.1 s, then around `around` with a search of `swing`.
double slip_at(double t, double around, double swing) { return t < 0.1 ? t : around + swing * std::sin(60.0 * t); }

control::SlipPeakEstimator make(double rate_Hz = 1000.0) {
  return control::SlipPeakEstimator{control::SlipPeakOptions<>{}, 0.01, 0.3, rate_Hz};
}

void feed(control::SlipPeakEstimator& peak, const Curve& force, double from_s, double to_s, double rate_Hz = 1000.0,
          double noise_N = 0.0, double around = 0.06) {
  std::mt19937_64 random{3};
  std::normal_distribution<double> noise{0.0, 1.0};
  for (double t = from_s; t < to_s; t += 1 / rate_Hz) {
    const double slip = slip_at(t, around, 0.012);
    peak.update(1 / rate_Hz, slip, force(slip) + noise_N * noise(random));
  }
}

}  // namespace

TEST_CASE("A curve of its own family is found exactly") {
  auto peak = make();
  const Curve force = [](double slip) {
    const double x = (slip + 0.004) / 0.05, c = 0.7;
    return 31.0 * (2 + c) * x / (1 + c * x + x * x);
  };
  feed(peak, force, 0.0, 2.0);
  CHECK_THAT(peak.peak_slip(), WithinRel(0.046, 0.02));
  CHECK_THAT(peak.peak_force_N(), WithinRel(31.0, 0.01));
  CHECK_THAT(peak.force_N(0.03), WithinRel(force(0.03), 0.02));
}

TEST_CASE("The peak of another family is found near enough that its force is lost by less than 1 %") {
  for (const double B : {15.0, 28.0, 40.0}) {
    for (const double C : {1.4, 1.68, 1.85}) {
      CAPTURE(B, C);
      auto peak = make();
      const Curve force = magic(23.0, B, C);
      const double around = std::tan(std::acos(-1.0) / (2 * C)) / B;
      feed(peak, force, 0.0, 1.5, 1000.0, 0.5, around);
      CHECK(force(peak.peak_slip()) > 0.99 * 23.0);
      CHECK(peak.jumps() == 0);
    }
  }
}

TEST_CASE("The slope is the curve's derivative") {
  auto peak = make();
  feed(peak, magic(23.0, 28.0, 1.68), 0.0, 0.5);
  for (const double slip : {-0.03, 0.01, 0.05, 0.12}) {
    const double numeric = (peak.force_N(slip + 1e-6) - peak.force_N(slip - 1e-6)) / 2e-6;
    CHECK_THAT(peak.force_slope_N(slip), WithinAbs(numeric, 1e-3 * std::abs(numeric) + 1e-3));
  }
}

TEST_CASE("A jump of friction is found, moves the level and leaves the place of the peak") {
  auto peak = make();
  feed(peak, magic(23.0, 28.0, 1.68), 0.0, 0.8);
  const double before = peak.peak_slip();
  feed(peak, magic(12.0, 28.0, 1.68), 0.8, 0.9);
  CHECK(peak.jumps() == 1);
  CHECK_THAT(peak.peak_slip(), WithinRel(before, 0.05));
  CHECK_THAT(peak.peak_force_N(), WithinRel(12.0, 0.05));
  peak.reset();
  CHECK(peak.jumps() == 0);
}

TEST_CASE("What it learns hardly depends on the rate") {
  double first = 0.0;
  for (const double rate_Hz : {500.0, 1000.0, 5000.0}) {
    auto peak = make(rate_Hz);
    feed(peak, magic(23.0, 28.0, 1.68), 0.0, 1.0, rate_Hz);
    if (first == 0.0) first = peak.peak_slip();
    CHECK_THAT(peak.peak_slip(), WithinRel(first, 0.02));
  }
}

TEST_CASE("A jump takes the curve back by 30 ms at every rate") {
  // The zero of the slip is where the curve is 0, and the width is the peak's distance from it.
  const auto width = [](const control::SlipPeakEstimator& peak) {
    double low = -0.05, high = 0.05;
    for (int i = 0; i < 60; ++i) (peak.force_N(0.5 * (low + high)) < 0.0 ? low : high) = 0.5 * (low + high);
    return peak.peak_slip() - low;
  };
  for (double rate_Hz = 100.0; rate_Hz <= 10'000.0; rate_Hz += rate_Hz < 3000.0 ? 61.0 : 503.0) {
    CAPTURE(rate_Hz);
    auto peak = make(rate_Hz);
    std::vector<double> widths;
    const Curve before = magic(23.0, 28.0, 1.68), after = magic(10.0, 28.0, 1.68);
    int n = 0;
    for (; peak.jumps() == 0 && n < 2.0 * rate_Hz; ++n) {
      const double t = n / rate_Hz, slip = slip_at(t, 0.06, 0.012);
      widths.push_back(width(peak));
      peak.update(1 / rate_Hz, slip, (t < 0.8 ? before : after)(slip));
    }
    REQUIRE(peak.jumps() == 1);
    // It learns on for up to 15 ms after the friction has jumped. The samples lie 1 ms, or a cycle, apart.
    const double sample_s = std::max(1.0, std::round(1e-3 * rate_Hz)) / rate_Hz;
    bool found = false;
    for (std::size_t i = 0; i < widths.size(); ++i) {
      const double back_s = (static_cast<double>(widths.size()) - static_cast<double>(i)) / rate_Hz;
      if (std::abs(back_s - 0.03) > 1.01 * sample_s + 1.01 / rate_Hz) continue;
      found = found || std::abs(widths[i] - width(peak)) < 1e-9;
    }
    CHECK(found);
  }
}

TEST_CASE("Bounds and drifts that make no sense are refused") {
  const auto refused = [](const control::SlipPeakOptions<>& options, double slip_min, double slip_max, double rate_Hz) {
    CHECK_THROWS_AS((control::SlipPeakEstimator{options, slip_min, slip_max, rate_Hz}), std::invalid_argument);
  };
  refused({}, 0.0, 0.3, 1000.0);
  refused({}, 0.3, 0.2, 1000.0);
  refused({}, 0.01, 0.3, 0.0);
  refused({.peak_slip0 = 0.4}, 0.01, 0.3, 1000.0);
  refused({.slip_drift_per_s = 0.0}, 0.01, 0.3, 1000.0);
}
