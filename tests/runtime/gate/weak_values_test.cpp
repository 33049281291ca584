// Options that weaken a board's protection, and the keys that consent to them.
#include "runtime/weak_values.hpp"

#include <string>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
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

TEST_CASE("a key in the list consents to its own value alone") {
  const WeakValue weak{.key = "gate.overspeed_rad_s"};
  for (const char* keys : {"gate.overspeed_rad_s", "gate.overspeed_rad_s,a", "a,gate.overspeed_rad_s",
                           "a,gate.overspeed_rad_s,b", ",gate.overspeed_rad_s"})
    CHECK(has_consent(weak, {.keys = keys}));
  for (const char* keys : {"", ",", "gate", "gate.overspeed_rad_s2", "xgate.overspeed_rad_s", "gate.overspeed_rad_",
                           "gate.overspeed_rad_s a", "a, gate.overspeed_rad_s"})
    CHECK_FALSE(has_consent(weak, {.keys = keys}));
}

TEST_CASE("an empty list consents to nothing") {
  CHECK_FALSE(has_consent({}, {}));
  CHECK_FALSE(has_consent({}, {.keys = "a"}));
}

TEST_CASE("a flag consents to the values whose rows name it") {
  const WeakValue weak{.key = "a", .consent = "blind_control"};
  CHECK(has_consent(weak, {.blind_control = true}));
  CHECK(has_consent(weak, {.outputs_on_after_death = true, .blind_control = true, .foreign_controller = true}));
  CHECK_FALSE(has_consent(weak, {}));
  CHECK_FALSE(has_consent(weak, {.outputs_on_after_death = true, .foreign_controller = true}));
  CHECK_FALSE(has_consent({.key = "a"}, {.outputs_on_after_death = true, .blind_control = true}));
  CHECK(has_consent({.key = "a", .consent = "outputs_on_after_death"}, {.outputs_on_after_death = true}));
}
