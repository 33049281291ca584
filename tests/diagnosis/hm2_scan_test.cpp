// What `abs_hil doctor` makes of ARP tables and round trips.

#include "catch.hpp"
#include "driver/hm2/hm2_driver.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::hm2;
using Catch::Matchers::Contains;

TEST_CASE("Only a permanent ARP entry is good; the fix is a command") {
  const std::string head = "IP address       HW type     Flags       HW address            Mask     Device\n";
  const std::string dynamic = head + "192.168.1.121    0x1         0x2         00:60:1b:16:00:01     *        enp3s0\n";
  const std::string fixed = head + "192.168.1.121    0x1         0x6         00:60:1b:16:00:01     *        enp3s0\n";
  CHECK(judge_arp(fixed, "192.168.1.121", "enp3s0").standing == Finding::Standing::good);
  const Finding found = judge_arp(dynamic, "192.168.1.121", "enp3s0");
  CHECK(found.standing == Finding::Standing::warning);
  CHECK(found.fix == "sudo ip neigh replace 192.168.1.121 lladdr 00:60:1b:16:00:01 nud permanent dev enp3s0");
  CHECK(judge_arp(fixed, "192.168.1.12", "enp3s0").detail == "none");
}

TEST_CASE("Round trips: losses, slow answers and other senders are warnings, silence is a failure") {
  CHECK(judge_round_trips({}, 500, 0).standing == Finding::Standing::failure);
  const Finding good = judge_round_trips({30, 20, 10, 40, 50}, 5, 0);
  CHECK(good.standing == Finding::Standing::good);
  CHECK_THAT(good.detail, Contains("5 of 5 answered; least 10, half 30, 90 % 40, 99 % 40, most 50 us"));
  CHECK(judge_round_trips({30, 20}, 3, 0).standing == Finding::Standing::warning);
  CHECK(judge_round_trips({30, 900}, 2, 0).standing == Finding::Standing::warning);
  CHECK_THAT(judge_round_trips({30, 20}, 2, 7).detail, Contains("7 packets came from others"));
}
