// Which values of an option weaken a board's protection.
#include <string>

#include "abs_hil/rig/option.hpp"
#include "catch.hpp"

using namespace abs_hil;
using Kind = rig::SafetyClass::Kind;

TEST_CASE("a value weakens on the far side of its bound, and only by its class") {
  CHECK(rig::weaker_above(40).weakened_by(40.001));
  CHECK_FALSE(rig::weaker_above(40).weakened_by(40.0));
  CHECK(rig::weaker_below(2).weakened_by(1.999));
  CHECK_FALSE(rig::weaker_below(2).weakened_by(2.0));
  CHECK(rig::weaker_unless(0.0).weakened_by(1e-9));
  CHECK(rig::weaker_unless(0.0).weakened_by(-1e-9));
  CHECK_FALSE(rig::weaker_unless(0.0).weakened_by(0.0));
  CHECK(rig::weaker_unless("here").weakened_by("there"));
  CHECK_FALSE(rig::weaker_unless("here").weakened_by("here"));
  CHECK(rig::weaker_if("off").weakened_by("off"));
  CHECK_FALSE(rig::weaker_if("off").weakened_by("auto"));
  for (const Kind kind : {Kind::unclassed, Kind::none, Kind::commissioned, Kind::elsewhere, Kind::consent}) {
    for (const double value : {-1e9, 0.0, 1.0, 1e9}) CHECK_FALSE(rig::SafetyClass{.kind = kind}.weakened_by(value));
    for (const char* text : {"", "off"})
      CHECK_FALSE(rig::SafetyClass{.kind = kind}.weakened_by(std::string_view(text)));
  }
  CHECK_FALSE(rig::weaker_above(40).weakened_by("x"));
}
