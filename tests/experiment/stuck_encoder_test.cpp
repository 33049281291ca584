// An upper encoder that stops counting while its wheel is braked: found in time at every rate, however slow the reads.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "injected_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

namespace {

/// docs/safety.md, "A stuck encoder or a locked wheel?": half a second, and two speed windows beyond 2 ms.
double bound_s(double rate_Hz, double share) {
  const double shortest_s = std::max(1.8e-3, 8.0 * share / rate_Hz);  // the stamp stands at the start of the reading
  return 0.5 + 2.0 * (std::ceil(shortest_s * rate_Hz) / rate_Hz - 2e-3);
}

/// Time from the fault to the end of the run, s.
struct Found {
  rig::Reason reason{rig::Reason::none};
  double after_s{0.0};
};

bool names_it(rig::Reason reason) {
  return reason == rig::Reason::encoder_upper_stuck || reason == rig::Reason::released_wheel_stands;
}

Found found(const std::string& controller, double rate_Hz, double share, const std::string& delay_s) {
  Setup setup = braking(controller);
  setup.control.rate_Hz = rate_Hz;
  std::vector<config::Injection> faults{config::parse_injection("brake@encoder_upper:stuck+" + delay_s + "s")};
  if (share > 0.0) faults.push_back(slow_reads(share, rate_Hz));
  const InjectedResult run = run_injected(setup, faults);
  return {run.outcome.reason, run.records.back().time_s - std::stod(delay_s)};
}

}  // namespace

TEST_CASE("a stuck upper encoder is found in time, at every rate and with slow reads") {
  for (const double rate_Hz : {100.0, 250.0, 500.0, 1000.0, 2000.0, 10'000.0}) {
    for (const double share : {0.0, 0.4, 0.55, 0.7, 0.95}) {
      for (const std::string delay_s : {"0.1", "0.3", "0.65", "1.2"}) {
        CAPTURE(rate_Hz, share, delay_s);
        const Found result = found("adaptive", rate_Hz, share, delay_s);
        CHECK(names_it(result.reason));
        CHECK(result.after_s <= bound_s(rate_Hz, share));
      }
    }
  }
}

TEST_CASE("every controller that lets go of a wheel without counts is stopped in time") {
  for (const auto& controller : control::controllers()) {
    if (controller.name == "locked") continue;  // it holds the brake, so its wheel is locked
    for (const double rate_Hz : {100.0, 1000.0}) {
      for (const double share : {0.0, 0.55, 0.95}) {
        CAPTURE(controller.name, rate_Hz, share);
        const Found result = found(std::string(controller.name), rate_Hz, share, "0.65");
        CHECK(names_it(result.reason));
        CHECK(result.after_s <= bound_s(rate_Hz, share));
      }
    }
  }
}
