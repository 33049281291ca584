// A cycle of driver.kind=can allocates nothing and takes no lock, with good answers, lost ones and wrong ones. The node
// runs in a thread of its own, whose allocations and locks do not count.

#include "catch.hpp"
#include "driver/can/node_on_socket.hpp"
#include "interposed.hpp"

using namespace abs_hil;

TEST_CASE("read and write of the CAN driver neither allocate nor lock, for any answer") {
  constexpr std::int64_t ms = 1'000'000;
  for (const char* fault : {"ok", "drop=3", "babble=20", "wrong-size=5", "silent"}) {
    INFO(fault);
    abs_hil::test::NodeOnSocket node({.start_speed_rad_s = 60.0});
    driver::can::CanDriver driver({.answer_timeout_us = 2000}, node.opener_to_thread(), true);
    driver.configure();
    driver.activate(0);
    node.fault(fault);
    rig::Measurement measurement;
    bool good = true;
    runtime::test::Offences offences;
    {
      const runtime::test::OffenceCounter counter;
      for (std::int64_t now_ns = ms; now_ns <= 50 * ms; now_ns += ms) {
        good = driver.read(now_ns, measurement).ok() && good;
        static_cast<void>(driver.write({.brake_duty = 0.5}));
      }
      offences = counter.so_far();
    }
    CHECK(offences.allocations == 0);
    CHECK(offences.locks == 0);
    CHECK(good == (std::string(fault) == "ok" || std::string(fault) == "drop=3"));
  }
}
