// The text of a friction profile and its pieces.
#include "abs_hil/plant_sim/factor_profile.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "catch.hpp"

using abs_hil::plant_sim::FactorProfile;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinRel;

namespace {

std::string error_of(const std::string& text) {
  try {
    const FactorProfile profile(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("An empty text is friction 1 throughout") {
  for (const char* text : {"", "  "}) {
    const FactorProfile profile(text);
    REQUIRE(profile.pieces().size() == 1);
    CHECK(profile.pieces()[0].value == 1.0);
    CHECK(profile.pieces()[0].slope == 0.0);
    CHECK(std::isinf(profile.pieces()[0].end));
    CHECK(profile.highest() == 1.0);
  }
}

TEST_CASE("Jumps and ramps become pieces without gaps") {
  const FactorProfile profile(" braking distance : 1 ;0.5 at 2;  1.5 from 2.5 to 4.5; 0.25 at 4.5 ; 1 from 6 to 7;");
  CHECK(profile.axis() == FactorProfile::Axis::distance);
  CHECK(profile.from_braking());
  CHECK(profile.highest() == 1.5);
  struct Expected {
    double begin, end, value, slope;
  };
  const Expected expected[] = {{0, 2, 1, 0},      {2, 2.5, 0.5, 0},   {2.5, 4.5, 0.5, 0.5},
                               {4.5, 6, 0.25, 0}, {6, 7, 0.25, 0.75}, {7, INFINITY, 1, 0}};
  REQUIRE(profile.pieces().size() == std::size(expected));
  for (std::size_t i = 0; i < std::size(expected); ++i) {
    INFO(i);
    CHECK(profile.pieces()[i].begin == expected[i].begin);
    CHECK(profile.pieces()[i].end == expected[i].end);
    CHECK(profile.pieces()[i].value == expected[i].value);
    CHECK(profile.pieces()[i].slope == expected[i].slope);
  }
}

TEST_CASE("A ramp may begin at 0, right after a jump and right after a ramp") {
  const FactorProfile profile("time: 1; 0.5 from 0 to 1; 2 from 1 to 2; 1 at 3; 0.5 from 3 to 4");
  REQUIRE(profile.pieces().size() == 5);
  CHECK(profile.pieces()[0].slope == -0.5);
  CHECK(profile.pieces()[1].slope == 1.5);
  CHECK(profile.pieces()[3].value == 1.0);
  CHECK(profile.axis() == FactorProfile::Axis::time);
  CHECK_FALSE(profile.from_braking());
}

TEST_CASE("An invalid profile is refused with the invalid part") {
  const auto [text, error] = GENERATE(table<const char*, const char*>({
      {"1; 0.5 at 2", "\"1; 0.5 at 2\" names no axis; begin with \"time:\", \"distance:\", \"braking time:\""},
      {"way: 1", "\"way\" is not an axis; write time, distance, braking time or braking distance"},
      {"time distance: 1", "\"time distance\" is not an axis"},
      {"braking: 1", "\"braking\" is not an axis"},
      {": 1", "\"\" is not an axis"},
      {"time:", "\"\" holds \"\" instead of a number"},
      {"time: 0.5 at 1", "\"0.5 at 1\" holds \"0.5 at 1\" instead of a number"},
      {"time: 1; 0.5", "\"0.5\" is not a change; write \"VALUE at POSITION\" or \"VALUE from POSITION to POSITION\""},
      {"time: 1;; 0.5 at 1", "\"\" is not a change"},
      {"time: 1; 0.5 at", "\"0.5 at\" is not a change"},
      {"time: 1; 0.5 from 1 until 2", "is not a change"},
      {"time: 1; 0.5 at soon", "\"0.5 at soon\" holds \"soon\" instead of a number"},
      {"time: 1; 0.5 at 1s", "holds \"1s\" instead of a number"},
      {"time: 1; 0.5 at nan", "holds \"nan\" instead of a number"},
      {"time: 1; 0.5 at inf", "holds \"inf\" instead of a number"},
      {"time: 0", "\"0\" has a factor outside (0, 10]"},
      {"time: 1; -1 at 1", "\"-1 at 1\" has a factor outside (0, 10]"},
      {"time: 1; 11 at 1", "\"11 at 1\" has a factor outside (0, 10]"},
      {"time: 1; 0.5 from 2 to 2", "\"0.5 from 2 to 2\" must end after it begins"},
      {"time: 1; 0.5 at 2; 1 at 1", "\"1 at 1\" must not begin before the previous change has ended"},
      {"time: 1; 0.5 from 1 to 3; 1 at 2", "\"1 at 2\" must not begin before the previous change has ended"},
      {"time: 1; 0.5 at -1", "\"0.5 at -1\" must not begin before the previous change has ended"},
      {"time: 1; 0.5 at 2; 1 at 2", "\"1 at 2\" must come after the previous jump and after 0"},
      {"time: 1; 0.5 at 0", "\"0.5 at 0\" must come after the previous jump and after 0"},
  }));
  CHECK_THAT(error_of(text), Contains(std::string("plant.friction_profile: ")) && Contains(error));
}
