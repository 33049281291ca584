// Counts and angles.
#include "rig/encoder_scale.hpp"

#include <cstdint>
#include <limits>

#include "catch.hpp"

using namespace abs_hil::rig;

TEST_CASE("counts between two readings") {
  constexpr std::int32_t most = std::numeric_limits<std::int32_t>::max();
  constexpr std::int32_t least = std::numeric_limits<std::int32_t>::min();
  CHECK(counts_between(10, 15) == 5);
  CHECK(counts_between(15, 10) == -5);
  CHECK(counts_between(most, least) == 1);
  CHECK(counts_between(least, most) == -1);
  CHECK(counts_between(most - 2, least + 4) == 7);
}

TEST_CASE("a revolution of counts is two pi") { CHECK(radians_per_count(4096) * 4096 == 2.0 * std::numbers::pi); }
