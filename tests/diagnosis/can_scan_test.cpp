// What `abs_hil doctor` says of a CAN interface.
#include "catch.hpp"
#include "driver/can/bus.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::can;

namespace {

InterfaceFacts good() {
  return {.name = "can0", .kind = "can", .up = true, .running = true, .state = "error-active", .bit_rate = 1'000'000};
}

Finding finding_of(const InterfaceFacts& facts, double rate_Hz = 1000) { return judge({facts}, true, rate_Hz).front(); }

bool holds(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("an interface that is up is good, with state, bit rate and load") {
  const Finding f = finding_of(good());
  CHECK(f.standing == Finding::Standing::good);
  CHECK(holds(f.detail, "error-active"));
  CHECK(holds(f.detail, "1000000 bit/s"));
  CHECK(holds(f.detail, "load at most 50.7 %"));
}

TEST_CASE("each problem of an interface is reported with its fix") {
  InterfaceFacts facts = good();
  facts.up = facts.running = false;
  facts.state = "stopped";
  CHECK(finding_of(facts).standing == Finding::Standing::warning);
  CHECK(holds(finding_of(facts).fix, "ip link set can0 type can bitrate 1000000"));

  facts = good();
  facts.state = "bus-off";
  facts.running = false;
  CHECK(finding_of(facts).standing == Finding::Standing::warning);
  CHECK(holds(finding_of(facts).fix, "down && sudo ip link set can0 up"));

  facts = good();
  facts.state = "error-passive";
  facts.transmit_errors = 130;
  CHECK(holds(finding_of(facts).detail, "error counters 130"));
  CHECK(holds(finding_of(facts).fix, "120 ohm"));

  facts = good();
  facts.bit_rate = 500'000;
  CHECK(finding_of(facts).standing == Finding::Standing::warning);
  CHECK(finding_of(facts, 500).standing == Finding::Standing::good);
}

TEST_CASE("a virtual interface is reported as virtual; a missing interface is a note") {
  const InterfaceFacts vcan{.name = "vcan0", .kind = "vcan", .up = true, .running = true, .can_fd = true};
  CHECK(finding_of(vcan).standing == Finding::Standing::good);
  CHECK(holds(finding_of(vcan).detail, "virtual"));
  InterfaceFacts down = vcan;
  down.up = false;
  CHECK(finding_of(down).fix == "sudo ip link set vcan0 up");
  const auto none = judge({}, false, 1000);
  CHECK(none.front().standing == Finding::Standing::note);
  CHECK(holds(none.front().detail, "can_raw"));
  CHECK(holds(none.back().detail, "50.7 % of 1 Mbit/s"));
}
