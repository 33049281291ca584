// How each key bears on the safety of a run on a board: `abs_hil list --keys` prints the same rows.

#include <set>
#include <stdexcept>
#include <string>

#include "abs_hil/rig/option_check.hpp"
#include "catch.hpp"
#include "config/board_policy.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;
using Kind = rig::SafetyClass::Kind;

namespace {

/// What the policy of a real board says of a run with this assignment; empty: it is allowed.
std::string refusal(const std::string& assignment, const std::string& consent = {}) {
  config::Settings s;
  config::KeyTable keys(s);
  s.backend = "rig";
  keys.leave_out_plant();
  keys.set_text(assignment, "test");
  if (!consent.empty()) keys.set_text(consent, "test");
  try {
    static_cast<void>(config::refuse_unsafe_use(s, config::safety_view(s, keys, {}), false));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("every key of the tables that protect a board has a class in its row") {
  config::Settings s;
  const config::KeyTable keys(s);
  std::set<std::string> tables;
  for (const config::Key& key : keys.keys()) {
    INFO(key.name);
    CHECK(config::safety_of(key).kind != Kind::unclassed);
    for (const std::string table : {"driver.", "gate.", "guardian.", "realtime.", "experiment.", "unsafe."}) {
      if (!key.name.starts_with(table)) continue;
      tables.insert(table);
      CHECK(key.safety.kind != Kind::unclassed);
    }
    if (key.name.starts_with("unsafe.")) CHECK(key.safety.kind == Kind::consent);
    if (key.name.starts_with("rig.")) CHECK(config::safety_of(key).kind == Kind::commissioned);
  }
  CHECK(tables.size() == 6);
  // A row of a protecting table that says nothing is no safe one.
  const config::Key unclassed{{}, "gate.new_limit", static_cast<double*>(nullptr)};
  CHECK(config::safety_of(unclassed).kind == Kind::unclassed);
}

TEST_CASE("no default weakens the protection") {
  config::Settings s;
  const config::KeyTable keys(s);
  for (const config::Key& key : keys.keys()) {
    INFO(key.name);
    CHECK_FALSE(std::visit([&key](const auto* target) { return rig::weakens(key, *target); }, key.target));
  }
}

TEST_CASE("keys that once switched a protection off without a word need a person's consent on a board") {
  for (const std::string assignment :
       {"guardian.insist_s=0.001",      "guardian.resident=off",      "guardian.socket=/tmp/none",
        "guardian.timeout_ms=41",       "gate.overspeed_rad_s=2000",  "experiment.cut_speed_rad_s=1000",
        "realtime.cycle_gap_max_s=10",  "realtime.late_max_s=1000",   "realtime.startup_cycles=100000",
        "gate.judge_within_s=1",        "gate.temperature_max_C=300", "gate.free_slip_max=1",
        "gate.sample_age_max_s=1",      "gate.brake_rate_per_s=1e6",  "gate.fault_brake_limit_s=60",
        "experiment.brake_limit_s=600", "experiment.answers=itself",  "driver.pci.plausible_speed_rad_s=100000",
        "driver.can.loss_cost=0",       "driver.can.watchdog_ms=51"}) {
    const std::string key = assignment.substr(0, assignment.find('='));
    INFO(assignment);
    CHECK_THAT(refusal(assignment), Contains(key + " = ") && Contains("unsafe.keys=" + key));
    CHECK(refusal(assignment, "unsafe.keys=" + key).empty());
    CHECK(refusal(assignment, "unsafe.keys=gate.motor_duty_max," + key + ",run.seed").empty());
  }
  // Up to its bound a value needs none, and what protects better never does.
  for (const std::string assignment :
       {"guardian.timeout_ms=40", "gate.overspeed_rad_s=250", "gate.overspeed_rad_s=1", "gate.sample_age_max_s=0.05",
        "experiment.brake_limit_s=30", "realtime.late_max_s=0.15", "realtime.max_consecutive_overruns=0",
        "model.theta_N=500", "model.motor_stall_torque_Nm=0.001"})
    CHECK(refusal(assignment).empty());
}

TEST_CASE("classes say in words what weakens") {
  CHECK(rig::weaker_above(40).in_words("ms") == "weakens above 40 ms");
  CHECK(rig::weaker_below(2).in_words("") == "weakens below 2");
  CHECK(rig::weaker_unless(0.0).in_words("s") == "weakens unless 0 s");
  CHECK(rig::weaker_if("off").in_words("") == "weakens if off");
  CHECK(rig::weakens({.safety = rig::weaker_if("false")}, false));
  CHECK_FALSE(rig::weakens({.safety = rig::weaker_if("false")}, true));
}
