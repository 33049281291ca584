// ClockLead on clocks that are drawn: each pause is found once, and nothing else is taken for one.
#include <cmath>
#include <cstdint>
#include <random>

#include "catch.hpp"
#include "guardian/machine.hpp"

using abs_hil::guardian::ClockLead;

namespace {

/// A machine whose real-time clock started `phase_s` into a second and runs by `drift` faster than its own.
struct Machine {
  double phase_s;
  double drift;
  double own_s{0.0};
  double paused_s{0.0};
  ClockLead lead{};

  bool look() {
    const double clock_s = 1.7e9 + phase_s + own_s * (1.0 + drift) + paused_s;
    return lead.leapt(static_cast<std::int64_t>(std::floor(clock_s)), static_cast<std::int64_t>(own_s * 1e9));
  }
  /// Number of pauses found.
  int run(double seconds, double every_s) {
    int found = 0;
    for (const double end_s = own_s + seconds; own_s < end_s; own_s += every_s) found += look() ? 1 : 0;
    return found;
  }
};

}  // namespace

TEST_CASE("no start of the clock and no drift looks like a pause") {
  std::mt19937 random(36);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 100; ++i) {
    Machine machine{.phase_s = unit(random), .drift = 0.001 * (unit(random) - 0.5)};
    CAPTURE(machine.phase_s, machine.drift);
    // Ten hours, at the rates without and with a lease.
    CHECK(machine.run(35'000.0, 0.1) + machine.run(30.0, 0.001) + machine.run(1000.0, 0.1) == 0);
  }
}

TEST_CASE("a pause is found once: at 1.5 s by the first look, at 0.6 s within a second") {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 300; ++i) {
    const bool soon = i % 2 == 0;
    Machine machine{.phase_s = unit(random), .drift = 0.0005 * (unit(random) - 0.5)};
    CAPTURE(i, machine.phase_s, machine.drift);
    REQUIRE(machine.run(2.0 + 3.0 * unit(random), 0.001) == 0);
    const double pause_s = soon ? 1.52 + 20.0 * unit(random) : 0.61 + 0.9 * unit(random);
    machine.paused_s += pause_s;
    CAPTURE(pause_s);
    if (soon) {
      CHECK(machine.look());
      CHECK(machine.run(5.0, 0.001) == 0);
    } else {
      CHECK(machine.run(1.002, 0.001) == 1);
      CHECK(machine.run(5.0, 0.001) == 0);
    }
  }
}

TEST_CASE("a clock that somebody has set is no pause") {
  Machine machine{.phase_s = 0.3, .drift = 0.0};
  REQUIRE(machine.run(3.0, 0.001) == 0);
  machine.paused_s += 86'400.0;
  CHECK(machine.run(3.0, 0.001) == 0);
  machine.paused_s -= 86'400.0;
  CHECK(machine.run(3.0, 0.001) == 0);
  machine.paused_s += 10.0;
  CHECK(machine.run(3.0, 0.001) == 1);
}
