// URBs that fail, boards that are unplugged, and recovery.

#include <cerrno>

#include "catch.hpp"
#include "urb_bench.hpp"

using namespace abs_hil;
using namespace abs_hil::driver::usb;
using namespace abs_hil::driver::usb::test_bench;
using Catch::Matchers::Contains;
using driver::IoError;
using driver::IoResult;
using driver::Unavailable;

TEST_CASE("A transfer that the kernel refuses has its error at once, and its slot stays free") {
  struct Case {
    int error;
    IoError expected;
    int errno_value;
  };
  for (const Case& c : {Case{-ENODEV, IoError::disconnected, ENODEV}, Case{-EPIPE, IoError::stalled, EPIPE},
                        Case{-ETIMEDOUT, IoError::no_answer, 0}, Case{-EBUSY, IoError::no_answer, 0},
                        Case{-ENOMEM, IoError::transfer_failed, ENOMEM},
                        // Of a submission, not of a cancelled transfer: the endpoint does not exist.
                        Case{-ENOENT, IoError::transfer_failed, ENOENT}}) {
    INFO("error " << c.error);
    OpenUrbBench bench;
    bench.usb.submit_error = c.error;
    for (int i = 0; i < 5; ++i) {
      const IoResult told = bench.link.send(frame_of(1));
      CHECK(told.error == c.expected);
      CHECK(told.errno_value == c.errno_value);
    }
    CHECK(bench.link.request().error == c.expected);
    CHECK_FALSE(bench.link.answer_outstanding());
    bench.usb.submit_error = 0;
    CHECK(bench.link.send(frame_of(2)).ok());
    CHECK(bench.link.request().ok());
  }
}

TEST_CASE("A board that is unplugged ends every wait, whether or not the kernel has ended the transfers yet") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  const bool transfers_end = GENERATE(true, false);
  usb.takes = GENERATE(true, false);
  usb.waiting = [&](std::int64_t /*timeout_ns*/) {
    usb.unplug(transfers_end);
    return 1000;
  };
  const std::int64_t started_ns = usb.time_ns;
  std::vector<std::uint8_t> bytes;
  CHECK(link.send(frame_of(1)).ok());
  CHECK(link.request().ok());
  const IoResult result = received(link, bytes, 1000 * ms);
  CHECK(result.error == IoError::disconnected);
  CHECK(result.errno_value == ENODEV);
  CHECK(link.send(frame_of(2)).error == IoError::disconnected);
  CHECK(link.flush(1000 * ms).ok());  // each failure is returned once
  link.recover();
  CHECK(link.request().error == IoError::disconnected);
  CHECK_FALSE(link.answer_outstanding());
  CHECK(usb.time_ns - started_ns == 1000);
}

TEST_CASE("Recovery cancels queued transfers, clears both stalls and drops the board's old answers") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  usb.takes = false;
  CHECK(link.send(frame_of(1)).ok());
  CHECK(link.request().ok());
  usb.takes = true;
  usb.answers = {{1}, {2}};
  // The frame under way is cancelled: only the answers asked for before are still to come.
  link.recover();
  CHECK(usb.under_way.empty());
  CHECK(usb.cleared_halts == std::vector<unsigned>{endpoint_out, endpoint_in});
  CHECK(usb.answers.empty());
  CHECK_FALSE(link.answer_outstanding());

  std::vector<std::uint8_t> bytes;
  CHECK(link.request().ok());
  usb.answers = {{3}};
  CHECK(received(link, bytes).ok());
  CHECK(bytes == std::vector<std::uint8_t>{3});

  // Recovery ends although the board goes on sending, and at once if the board is gone.
  usb.answers.assign(9, {4});
  link.recover();
  CHECK(usb.answers.size() == 5);
  usb.submit_error = -ENODEV;
  link.recover();
  CHECK(usb.answers.size() == 5);
}

TEST_CASE("Recovery gives up on transfers that the kernel does not cancel") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  usb.takes = false;
  for (int i = 0; i < 3; ++i) CHECK(link.send(frame_of(1)).ok());
  CHECK(link.request().ok());
  usb.discard_error = -EIO;
  const std::int64_t started_ns = usb.time_ns;
  link.recover();
  CHECK(usb.time_ns - started_ns == 2000 * ms);  // a second before the stalls are cleared, one after it
  CHECK(link.send(frame_of(2)).error == IoError::no_answer);
  // They may still end.
  usb.takes = true;
  usb.answers = {{1}};
  CHECK(link.flush(0).ok());
  CHECK_FALSE(link.answer_outstanding());
  CHECK(link.request().ok());
}
