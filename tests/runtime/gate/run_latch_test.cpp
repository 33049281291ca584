// The latch of a run: the first fault and the first request to stop stay, each by itself.
#include "runtime/run_latch.hpp"

#include "catch.hpp"

using namespace abs_hil;
using rig::Reason;

TEST_CASE("the first request to stop stays, and none changes nothing") {
  runtime::RunLatch latch;
  latch.latch(Reason::none, 1.0);
  CHECK(latch.stop_request() == Reason::none);
  latch.latch(Reason::interrupt_signal, 0.0);
  latch.latch(Reason::terminate_signal, 0.0);
  CHECK(latch.stop_request() == Reason::interrupt_signal);
  CHECK(latch.fault() == Reason::none);
}

TEST_CASE("the first fault stays with its value, also after a request to stop") {
  runtime::RunLatch latch;
  latch.latch(Reason::stop_command, 0.0);
  latch.latch(Reason::overspeed, 260.0);
  latch.latch(Reason::encoder_upper_stuck, 3.0);
  CHECK(latch.fault() == Reason::overspeed);
  CHECK(latch.fault_value() == 260.0);
  CHECK(latch.stop_request() == Reason::stop_command);
}

TEST_CASE("a later fault that bars the brake is kept beside the first one") {
  runtime::RunLatch latch;
  latch.latch(Reason::encoder_upper_stuck, 0.0);
  CHECK(latch.brake_barred_by() == Reason::none);
  latch.latch(Reason::driver_write_failed, 0.0);
  latch.latch(Reason::guardian_died, 0.0);
  CHECK(latch.brake_barred_by() == Reason::driver_write_failed);
  CHECK(latch.fault() == Reason::encoder_upper_stuck);
}
