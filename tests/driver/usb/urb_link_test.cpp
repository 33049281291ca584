// Frames as URBs, with a stand-in for the kernel's usbfs. The kernel's own USB is in the test vm_usb.

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "catch.hpp"
#include "driver/usb/wire.hpp"
#include "urb_bench.hpp"

using namespace abs_hil;
using namespace abs_hil::driver::usb;
using namespace abs_hil::driver::usb::test_bench;
using Catch::Matchers::Contains;
using driver::IoError;
using driver::IoResult;
using driver::Unavailable;

TEST_CASE("The interface with both of the FPGA's endpoints is claimed, and everything is released") {
  UrbBench bench;
  {
    const auto link = urb_link(bench.device(), bench.usb);
    CHECK(bench.usb.claimed == std::vector{1U});
    CHECK(bench.usb.chosen_settings.empty());  // 0 is what it has already
  }
  CHECK(bench.usb.claimed.empty());
  CHECK(bench.usb.open_files == 0);

  UrbBench other(3);
  const auto link = urb_link(other.device(), other.usb);
  CHECK(other.usb.chosen_settings == std::vector{3U});
}

TEST_CASE("A device that cannot be opened is refused with its name and the cause; nothing stays open") {
  UrbBench bench(1);
  auto& usb = bench.usb;
  const auto refusal = [&]() -> std::string {
    try {
      const auto link = urb_link(bench.device(), usb);
    } catch (const Unavailable& error) {
      CHECK(usb.open_files == 0);
      CHECK(usb.claimed.empty());
      CHECK_THAT(error.what(), Contains("04b4:1003 serial 77 at 1-1.4"));
      return error.what();
    }
    return "not refused";
  };
  SECTION("no node") {
    usb.open_error = -ENOENT;
    CHECK_THAT(refusal(), Contains("dev/001/012: No such file"));
  }
  SECTION("no permission") {
    usb.open_error = GENERATE(-EACCES, -EPERM);
    CHECK_THAT(refusal(), Contains("dev/001/012: ") && Contains(R"(ATTR{idVendor}=="04b4")"));
  }
  SECTION("not readable") {
    usb.read_error = -ENODEV;
    CHECK_THAT(refusal(), Contains("its descriptors cannot be read: No such device"));
  }
  SECTION("not configured: the kernel's file is empty") {
    bench.system.put("usb/1-1.4/bConfigurationValue", "");
    CHECK_THAT(refusal(), Contains("has no configuration"));
  }
  SECTION("configured as another") {
    bench.system.put("usb/1-1.4/bConfigurationValue", "2");
    CHECK_THAT(refusal(), Contains("bulk endpoints 02 (out) and 84 (in)"));
  }
  SECTION("without its endpoints") {
    bench.put_settings({{.number = 0, .endpoints = {{0x06}, {0x88}}}});
    CHECK_THAT(refusal(), Contains("bulk endpoints 02 (out) and 84 (in)"));
  }
  SECTION("with one endpoint of another kind") {
    constexpr std::uint8_t interrupt = 3;
    bench.put_settings({{.number = 1, .endpoints = {{endpoint_out}, {endpoint_in, interrupt}}}});
    CHECK_THAT(refusal(), Contains("bulk endpoints 02 (out) and 84 (in)"));
  }
  SECTION("in use") {
    usb.claim_error = -EBUSY;
    CHECK_THAT(refusal(), Contains("in use by another process"));
  }
  SECTION("not to be claimed") {
    usb.claim_error = -ENODEV;
    CHECK_THAT(refusal(), Contains("cannot be claimed: No such device"));
  }
  SECTION("not to be set") {
    usb.setting_error = -EINVAL;
    CHECK_THAT(refusal(), Contains("does not accept its alternate setting: Invalid argument"));
  }
}

TEST_CASE("Frames reach the board in their order; one too many is refused, not queued") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  usb.takes = false;
  for (const std::uint8_t value : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}})
    CHECK(link.send(frame_of(value)).ok());
  CHECK(link.send(frame_of(4)).error == IoError::no_answer);
  CHECK(link.flush(0).error == IoError::no_answer);
  usb.takes = true;
  CHECK(link.send(frame_of(5)).ok());  // the three before it are taken now
  CHECK(link.flush(1000 * ms).ok());
  REQUIRE(usb.sent.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::array<std::uint8_t, 4> order{1, 2, 3, 5};
    CHECK(usb.sent[i] == bytes_of(frame_of(order[i])));
  }
}

TEST_CASE("A request's answer arrives completely, with any length") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  std::vector<std::uint8_t> bytes;
  CHECK(link.request().ok());
  CHECK(link.answer_outstanding());
  CHECK(link.request().error == IoError::no_answer);  // one at a time
  CHECK(received(link, bytes).error == IoError::no_answer);
  CHECK(link.answer_outstanding());
  REQUIRE(usb.sent.size() == 1);
  CHECK(usb.sent[0] == bytes_of(frame_request));
  for (const std::size_t length : {frame_bytes, std::size_t{0}, std::size_t{3}, std::size_t{512}}) {
    if (!link.answer_outstanding()) CHECK(link.request().ok());
    usb.answers.emplace_back(length, std::uint8_t{0x5A});
    CHECK(received(link, bytes).ok());
    CHECK(bytes == std::vector<std::uint8_t>(length, 0x5A));
    CHECK_FALSE(link.answer_outstanding());
  }
}

TEST_CASE("Waiting ends at its time, to the nanosecond, however often it is interrupted; an answer ends it at once") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  std::vector<std::uint8_t> bytes;
  const std::int64_t started_ns = usb.time_ns;
  CHECK(link.request().ok());
  CHECK(received(link, bytes, 500'001).error == IoError::no_answer);
  CHECK(usb.time_ns - started_ns == 500'001);

  usb.waiting = [](std::int64_t timeout_ns) { return std::min<std::int64_t>(timeout_ns, 100'000); };
  CHECK(received(link, bytes, 450'000).error == IoError::no_answer);
  CHECK(usb.time_ns - started_ns == 950'001);

  usb.waiting = [&usb](std::int64_t /*timeout_ns*/) {
    usb.answers = {{1, 2}};
    return 200'000;
  };
  CHECK(received(link, bytes, 500'000).ok());
  CHECK(bytes == std::vector<std::uint8_t>{1, 2});
  CHECK(usb.time_ns - started_ns == 1'150'001);

  usb.waiting = {};
  usb.takes = false;
  CHECK(link.send(frame_of(1)).ok());
  CHECK(link.flush(3 * ms).error == IoError::no_answer);
  CHECK(usb.time_ns - started_ns == 4'150'001);
}

TEST_CASE("A cycle makes three submissions, at most two reaps for each, and two waits") {
  OpenUrbBench bench;
  UsbfsStandIn& usb = bench.usb;
  FrameLink& link = bench.link;
  usb.takes = false;
  // The board takes the frame and the request, then answers.
  usb.waiting = [&usb](std::int64_t /*timeout_ns*/) {
    if (usb.takes) usb.answers.emplace_back(frame_bytes, std::uint8_t{1});
    usb.takes = true;
    return 100'000;
  };
  for (int cycle = 1; cycle <= 100; ++cycle) {
    INFO("cycle " << cycle);
    usb.takes = false;
    std::vector<std::uint8_t> bytes;
    CHECK(link.request().ok());
    CHECK(received(link, bytes, ms).ok());
    CHECK(link.send(frame_of(1)).ok());
    CHECK(usb.submissions == 3 * cycle);
    CHECK(usb.waits == 2 * cycle);
    CHECK(usb.reaps <= 6 * cycle);
  }
}

TEST_CASE("The next call returns the result of a frame, once") {
  struct Case {
    int status;
    IoError error;
    int errno_value;
  };
  for (const Case& c :
       {Case{-EPIPE, IoError::stalled, EPIPE}, Case{-ENODEV, IoError::disconnected, ENODEV},
        Case{-ESHUTDOWN, IoError::disconnected, ENODEV}, Case{-EOVERFLOW, IoError::incomplete_answer, EOVERFLOW},
        Case{-ENOENT, IoError::no_answer, 0}, Case{-ECONNRESET, IoError::no_answer, 0},
        Case{-ETIME, IoError::transfer_failed, ETIME}, Case{-EPROTO, IoError::transfer_failed, EPROTO}}) {
    INFO("status " << c.status);
    OpenUrbBench bench;
    UsbfsStandIn& usb = bench.usb;
    FrameLink& link = bench.link;
    usb.out_status = c.status;
    CHECK(link.send(frame_of(1)).ok());
    const IoResult told = link.send(frame_of(2));
    CHECK(told.error == c.error);
    CHECK(told.where == endpoint_out);
    CHECK(told.errno_value == c.errno_value);
    usb.out_status = 0;
    CHECK(link.send(frame_of(3)).ok());
    CHECK(link.flush(1000 * ms).ok());
    REQUIRE(usb.sent.size() == 1);
    CHECK(usb.sent[0] == bytes_of(frame_of(3)));

    usb.out_status = c.status;
    CHECK(link.send(frame_of(4)).ok());
    CHECK(link.flush(1000 * ms).error == c.error);

    // A request that fails is found while its answer is waited for; what lies in the board stays there.
    std::vector<std::uint8_t> bytes;
    CHECK(link.request().ok());
    CHECK(received(link, bytes).error == c.error);
    CHECK(link.answer_outstanding());
    link.recover();
    CHECK_FALSE(link.answer_outstanding());

    usb.out_status = 0;
    usb.in_status = c.status;
    CHECK(link.request().ok());
    const IoResult answer = received(link, bytes);
    CHECK(answer.error == c.error);
    CHECK(answer.where == endpoint_in);
    CHECK_FALSE(link.answer_outstanding());
    CHECK(bytes.empty());
  }
}

TEST_CASE("A board opened in lock-step has the emulator's time, and its control requests their errors") {
  UrbBench bench;
  {
    const Board board = open_board(bench.options(), true, true, bench.usb);
    CHECK(board.place == "04b4:1003 serial 77 at 1-1.4");
    REQUIRE(board.time);
    std::int64_t time_ns = -1;
    CHECK(board.time->advance_to(1'500'000).ok());
    CHECK(board.time->now(time_ns).ok());
    CHECK(time_ns == 1'500'000);
    for (const auto& [result, expected] :
         {std::pair{-ENODEV, IoError::disconnected}, std::pair{-EPIPE, IoError::stalled},
          std::pair{-ETIMEDOUT, IoError::no_answer}, std::pair{3, IoError::transfer_failed}}) {
      bench.usb.control_result = result;
      CHECK(board.time->now(time_ns).error == expected);
      CHECK(time_ns == 1'500'000);
      CHECK(board.time->advance_to(2'000'000).error == expected);
    }
  }
  CHECK(bench.usb.open_files == 0);
}

TEST_CASE("The kernel's own calls return -errno, and waiting ends at its time") {
  Usbfs& kernel = kernel_usbfs();
  CHECK(kernel.open("/nonexistent/001/002") == -ENOENT);
  const int file = kernel.open("/dev/null");
  REQUIRE(file >= 0);
  CHECK(::fcntl(file, F_GETFD) == FD_CLOEXEC);
  std::array<std::uint8_t, 4> bytes{};
  CHECK(kernel.read(file, bytes) == 0);
  usbdevfs_urb* ended = nullptr;
  CHECK(kernel.ioctl(file, USBDEVFS_REAPURBNDELAY, &ended) == -ENOTTY);
  kernel.close(file);
  CHECK(kernel.read(file, bytes) == -EBADF);
  std::array<int, 2> pipe{};
  REQUIRE(::pipe(pipe.data()) == 0);
  const std::int64_t started_ns = kernel.now_ns();
  kernel.wait(pipe[1], 60'000 * ms);  // writable: at once
  CHECK(kernel.now_ns() - started_ns < 60'000 * ms);
  constexpr std::int64_t short_ns = 100'000;
  const std::int64_t again_ns = kernel.now_ns();
  kernel.wait(pipe[0], short_ns);  // never writable
  CHECK(kernel.now_ns() - again_ns >= short_ns);
  ::close(pipe[0]);
  ::close(pipe[1]);
}
