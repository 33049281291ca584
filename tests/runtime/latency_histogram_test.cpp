// Histograms of durations: bins, ends, quantiles.
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <sstream>
#include <vector>

#include "catch.hpp"
#include "runtime/cycle_statistics.hpp"

using namespace abs_hil::runtime;

namespace {
std::unique_ptr<LatencyHistogram> filled(const std::vector<std::int64_t>& durations_ns) {
  auto histogram = std::make_unique<LatencyHistogram>();
  for (const std::int64_t ns : durations_ns) histogram->add(ns);
  return histogram;
}
}  // namespace

TEST_CASE("without durations there are no quantiles") {
  const auto histogram = filled({});
  CHECK(std::isnan(histogram->summary().p50_us));
  CHECK(std::isnan(histogram->summary().max_us));
  CHECK(histogram->min_ns() == 0);
}

TEST_CASE("bins are whole microseconds; the ends are kept exactly") {
  const auto histogram = filled({0, 999, 1'000, 1'999, 2'000, 41'234});
  CHECK(histogram->in_bin(0) == 2);
  CHECK(histogram->in_bin(1) == 2);
  CHECK(histogram->in_bin(2) == 1);
  CHECK(histogram->in_bin(41) == 1);
  CHECK(histogram->count() == 6);
  CHECK(histogram->min_ns() == 0);
  CHECK(histogram->max_ns() == 41'234);
  CHECK(histogram->sum_ns() == 0 + 999 + 1'000 + 1'999 + 2'000 + 41'234);
}

TEST_CASE("durations beyond the last bin are counted and bound the quantiles by the maximum") {
  const auto histogram = filled({5'000, 9'999'999, 10'000'000, 60'000'000'000});
  CHECK(histogram->in_bin(9'999) == 1);
  CHECK(histogram->overflows() == 2);
  CHECK(histogram->summary().p50_us == 10'000.0);
  CHECK(histogram->summary().p99_us == 60'000'000.0);
}

TEST_CASE("a negative duration counts as 0") {
  const auto histogram = filled({-5});
  CHECK(histogram->in_bin(0) == 1);
  CHECK(histogram->min_ns() == 0);
}

TEST_CASE("quantiles are those of the sorted durations, rounded up to a microsecond") {
  std::mt19937_64 random(3);
  std::lognormal_distribution<double> latency_us(3.0, 0.8);
  for (const std::size_t size :
       {std::size_t{1}, std::size_t{2}, std::size_t{99}, std::size_t{1000}, std::size_t{50'000}}) {
    std::vector<std::int64_t> durations_ns(size);
    for (auto& ns : durations_ns) ns = static_cast<std::int64_t>(1e3 * latency_us(random));
    const auto summary = filled(durations_ns)->summary();
    std::sort(durations_ns.begin(), durations_ns.end());
    const auto expected_us = [&](double fraction) {
      const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(size)));
      const double max_us = static_cast<double>(durations_ns.back()) / 1000.0;
      return std::min(static_cast<double>(durations_ns[rank - 1] / 1000 + 1), max_us);
    };
    CHECK(summary.p50_us == expected_us(0.5));
    CHECK(summary.p99_us == expected_us(0.99));
    CHECK(summary.p99_9_us == expected_us(0.999));
    CHECK(summary.max_us == static_cast<double>(durations_ns.back()) / 1000.0);
  }
}

TEST_CASE("the histogram file has cyclictest's lines: counts add up, bins are consecutive") {
  const auto statistics = std::make_unique<CycleStatistics>();
  for (std::int64_t i = 0; i < 1'000; ++i) {
    statistics->add(
        {.wakeup_latency_ns = i * 40, .read_ns = 2'500, .control_ns = 1'000, .write_ns = 300, .cycle_ns = 3'800});
  }
  statistics->add(
      {.wakeup_latency_ns = 20'000'000, .read_ns = 2'500, .control_ns = 1'000, .write_ns = 300, .cycle_ns = 3'800});

  // As mklatencyplot.bash reads it: bins are the lines without '#', fields are split at blanks.
  std::istringstream lines(cyclictest_histogram(*statistics));
  std::vector<std::uint64_t> sums(5, 0U);
  std::uint64_t next_bin = 0;
  std::string maxima, totals, overflows, means;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("#")) {
      if (line.starts_with("# Max Latencies:")) maxima = line;
      if (line.starts_with("# Total:")) totals = line;
      if (line.starts_with("# Avg Latencies:")) means = line;
      if (line.starts_with("# Histogram Overflows:")) overflows = line;
      continue;
    }
    std::istringstream fields(line);
    std::uint64_t bin = 0;
    fields >> bin;
    CHECK(bin == next_bin++);
    for (std::uint64_t& sum : sums) {
      std::uint64_t count = 0;
      REQUIRE(fields >> count);
      sum += count;
    }
  }
  CHECK(next_bin == LatencyHistogram::bins);
  CHECK(sums == std::vector<std::uint64_t>{1'000, 1'001, 1'001, 1'001, 1'001});
  CHECK(totals == "# Total: 000001000 000001001 000001001 000001001 000001001");
  CHECK(means == "# Avg Latencies: 00039 00002 00001 00000 00003");
  CHECK(maxima == "# Max Latencies: 20000 00002 00001 00000 00003");
  CHECK(overflows == "# Histogram Overflows: 00001 00000 00000 00000 00000");
}
