#include "plant_sim/encoder.hpp"

#include <cstdint>
#include <limits>

#include "catch.hpp"
#include "rig/encoder_scale.hpp"

using abs_hil::plant_sim::encoder_counts;
using abs_hil::rig::counts_between;
using abs_hil::rig::radians_per_count;

namespace {

std::int32_t reading_at(double counts, std::int32_t counts_per_rev = 4096) {
  return encoder_counts(counts * radians_per_count(counts_per_rev), counts_per_rev);
}

constexpr std::int32_t highest = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t lowest = std::numeric_limits<std::int32_t>::min();

}  // namespace

TEST_CASE("A reading is the floor of the angle, below zero too") {
  CHECK(encoder_counts(0.0, 4096) == 0);
  CHECK(reading_at(0.999) == 0);
  CHECK(reading_at(1.001) == 1);
  CHECK(reading_at(-0.001) == -1);
  CHECK(reading_at(-0.999) == -1);
  CHECK(reading_at(-1.001) == -2);
  CHECK(reading_at(4096.5) == 4096);
  CHECK(reading_at(10.5, 4) == 10);
}

TEST_CASE("The counter wraps at 32 bits in both directions") {
  const double span = 4294967296.0;
  CHECK(reading_at(0.5 * span - 0.5) == highest);
  CHECK(reading_at(0.5 * span + 0.5) == lowest);
  CHECK(reading_at(-0.5 * span + 0.5) == lowest);
  CHECK(reading_at(-0.5 * span - 0.5) == highest);
  CHECK(reading_at(span + 7.5) == 7);
  CHECK(reading_at(-span - 7.5) == -8);
  CHECK(reading_at(1000.0 * span + 123.5) == 123);
}

TEST_CASE("Differences of readings are exact across the wrap and back") {
  const double near_wrap = 2147483640.5;
  for (int travel = -20; travel <= 20; ++travel) {
    CHECK(counts_between(reading_at(near_wrap), reading_at(near_wrap + travel)) == travel);
    CHECK(counts_between(reading_at(near_wrap + travel), reading_at(near_wrap)) == -travel);
  }
}
