// Frames over libusb, and each of its errors, with a stand-in for the library itself. The library and the kernel's own
// USB are in the test vm_usb.

#include "driver/usb/libusb_link.hpp"

#include <cerrno>

#include "abs_hil/driver/io_result.hpp"
#include "catch.hpp"
#include "diagnosis/fake_system.hpp"
#include "libusb_stand_in.hpp"

using namespace abs_hil;
using namespace abs_hil::driver::usb;
using abs_hil::diagnosis::test::FakeSystem;
using Catch::Matchers::Contains;
using driver::IoError;
using driver::IoResult;
using driver::Unavailable;
using test::libusb_stand_in;

namespace {

libusb_endpoint_descriptor endpoint(std::uint8_t address,
                                    std::uint8_t attributes = LIBUSB_ENDPOINT_TRANSFER_TYPE_BULK) {
  libusb_endpoint_descriptor descriptor{};
  descriptor.bEndpointAddress = address;
  descriptor.bmAttributes = attributes;
  return descriptor;
}

/// A fresh stand-in whose device has the FPGA's interface, and one of its JTAG before it.
struct Bench {
  Bench() {
    libusb_stand_in() = {};
    libusb_stand_in().settings = {{.number = 0, .endpoints = {endpoint(0x06), endpoint(0x88)}},
                                  {.number = 1, .endpoints = {endpoint(endpoint_out), endpoint(endpoint_in)}}};
    system.put("dev/001/012", "");
    const std::string folder = "usb/1-1.4/";
    system.put(folder + "idVendor", "04b4").put(folder + "idProduct", "1003").put(folder + "manufacturer", "InTeCo");
    system.put(folder + "serial", "77").put(folder + "busnum", "1").put(folder + "devnum", "12");
    system.put(folder + "product", "RT-DAC/USB2 emulator in lock-step");
  }
  [[nodiscard]] UsbOptions options() const {
    return {.sysfs_root = (system.root() / "usb").string(), .device_root = (system.root() / "dev").string()};
  }
  [[nodiscard]] UsbDevice device() const { return find_boards(options()).at(0); }
  [[nodiscard]] bool all_given_back() const {
    const auto& usb = libusb_stand_in();
    return usb.open_contexts == 0 && usb.open_handles == 0 && usb.configs == 0 && usb.transfers == 0;
  }
  FakeSystem system{};
};

Frame frame_of(std::uint8_t value) {
  Frame frame{};
  frame.fill(value);
  return frame;
}

std::vector<std::uint8_t> bytes_of(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

IoResult received(LibusbLink& link, std::vector<std::uint8_t>& bytes) {
  std::span<const std::uint8_t> view;
  const IoResult result = link.receive(0, view);
  bytes = bytes_of(view);
  return result;
}

}  // namespace

TEST_CASE("The interface with both of the FPGA's endpoints is claimed, and everything is released") {
  Bench bench;
  {
    const LibusbLink link(bench.device());
    CHECK(libusb_stand_in().claimed == std::vector{1});
    CHECK(libusb_stand_in().chosen_settings.empty());  // 0 is what it has already
    CHECK(libusb_stand_in().configs == 0);
  }
  CHECK(libusb_stand_in().claimed.empty());
  CHECK(bench.all_given_back());

  libusb_stand_in().settings[1].alternate = 3;
  const LibusbLink link(bench.device());
  CHECK(libusb_stand_in().chosen_settings == std::vector{3});
}

TEST_CASE("A device that cannot be opened is refused with its name and the cause; nothing stays open") {
  Bench bench;
  auto& usb = libusb_stand_in();
  const auto refusal = [&]() -> std::string {
    try {
      const LibusbLink link(bench.device());
    } catch (const Unavailable& error) {
      CHECK(bench.all_given_back());
      CHECK_THAT(error.what(), Contains("04b4:1003 serial 77 at 1-1.4"));
      return error.what();
    }
    return "not refused";
  };
  SECTION("no node") {
    std::filesystem::remove(bench.system.root() / "dev/001/012");
    CHECK_THAT(refusal(), Contains("dev/001/012: No such file"));
  }
  SECTION("no libusb") {
    usb.init_error = LIBUSB_ERROR_OTHER;
    CHECK_THAT(refusal(), Contains("libusb cannot start"));
  }
  SECTION("not taken by libusb") {
    usb.wrap_error = LIBUSB_ERROR_NOT_SUPPORTED;
    CHECK_THAT(refusal(), Contains("cannot be opened"));
  }
  SECTION("not configured") {
    usb.config_error = LIBUSB_ERROR_NOT_FOUND;
    CHECK_THAT(refusal(), Contains("has no configuration"));
  }
  SECTION("without its endpoints") {
    usb.settings.pop_back();
    CHECK_THAT(refusal(), Contains("bulk endpoints 02 (out) and 84 (in)"));
  }
  SECTION("with one endpoint of another kind") {
    usb.settings[1].endpoints[1] = endpoint(endpoint_in, LIBUSB_ENDPOINT_TRANSFER_TYPE_INTERRUPT);
    CHECK_THAT(refusal(), Contains("bulk endpoints 02 (out) and 84 (in)"));
  }
  SECTION("in use") {
    usb.claim_error = LIBUSB_ERROR_BUSY;
    CHECK_THAT(refusal(), Contains("in use by another process"));
  }
  SECTION("not to be claimed") {
    usb.claim_error = LIBUSB_ERROR_NO_DEVICE;
    CHECK_THAT(refusal(), Contains("cannot be claimed"));
  }
  SECTION("not to be set") {
    usb.settings[1].alternate = 1;
    usb.setting_error = LIBUSB_ERROR_NOT_FOUND;
    CHECK_THAT(refusal(), Contains("does not accept its alternate setting"));
  }
}

TEST_CASE("Frames reach the board in their order; one too many is refused, not queued") {
  Bench bench;
  LibusbLink link(bench.device());
  auto& usb = libusb_stand_in();
  usb.takes = false;
  for (const std::uint8_t value : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}})
    CHECK(link.send(frame_of(value)).ok());
  CHECK(link.send(frame_of(4)).error == IoError::no_answer);
  CHECK(link.flush(0).error == IoError::no_answer);
  usb.takes = true;
  CHECK(link.send(frame_of(5)).ok());  // the three before it are taken now
  CHECK(link.flush(1'000'000'000).ok());
  REQUIRE(usb.sent.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::array<std::uint8_t, 4> order{1, 2, 3, 5};
    CHECK(usb.sent[i] == bytes_of(frame_of(order[i])));
  }
}

TEST_CASE("A request's answer arrives completely, with any length") {
  Bench bench;
  LibusbLink link(bench.device());
  auto& usb = libusb_stand_in();
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

TEST_CASE("The next call returns the result of a frame, once") {
  struct Case {
    libusb_transfer_status status;
    IoError error;
    int errno_value;
  };
  for (const Case& c : {Case{LIBUSB_TRANSFER_STALL, IoError::stalled, EPIPE},
                        Case{LIBUSB_TRANSFER_NO_DEVICE, IoError::disconnected, ENODEV},
                        Case{LIBUSB_TRANSFER_OVERFLOW, IoError::incomplete_answer, EOVERFLOW},
                        Case{LIBUSB_TRANSFER_CANCELLED, IoError::no_answer, 0},
                        Case{LIBUSB_TRANSFER_TIMED_OUT, IoError::transfer_failed, 0},
                        Case{LIBUSB_TRANSFER_ERROR, IoError::transfer_failed, 0}}) {
    INFO("status " << c.status);
    Bench bench;
    LibusbLink link(bench.device());
    auto& usb = libusb_stand_in();
    usb.out_status = c.status;
    CHECK(link.send(frame_of(1)).ok());
    const IoResult told = link.send(frame_of(2));
    CHECK(told.error == c.error);
    CHECK(told.where == endpoint_out);
    CHECK(told.errno_value == c.errno_value);
    usb.out_status = LIBUSB_TRANSFER_COMPLETED;
    CHECK(link.send(frame_of(3)).ok());
    CHECK(link.flush(1'000'000'000).ok());
    REQUIRE(usb.sent.size() == 1);
    CHECK(usb.sent[0] == bytes_of(frame_of(3)));

    usb.out_status = c.status;
    CHECK(link.send(frame_of(4)).ok());
    CHECK(link.flush(1'000'000'000).error == c.error);

    // A request that fails is found while its answer is waited for; what lies in the board stays there.
    std::vector<std::uint8_t> bytes;
    CHECK(link.request().ok());
    CHECK(received(link, bytes).error == c.error);
    link.recover();

    usb.out_status = LIBUSB_TRANSFER_COMPLETED;
    usb.in_status = c.status;
    CHECK(link.request().ok());
    const IoResult answer = received(link, bytes);
    CHECK(answer.error == c.error);
    CHECK(answer.where == endpoint_in);
    CHECK_FALSE(link.answer_outstanding());
    CHECK(bytes.empty());
  }
}

TEST_CASE("A transfer that libusb refuses has its error at once, and its slot stays free") {
  struct Case {
    int error;
    IoError expected;
  };
  for (const Case& c : {Case{LIBUSB_ERROR_NO_DEVICE, IoError::disconnected}, Case{LIBUSB_ERROR_PIPE, IoError::stalled},
                        Case{LIBUSB_ERROR_TIMEOUT, IoError::no_answer}, Case{LIBUSB_ERROR_BUSY, IoError::no_answer},
                        Case{LIBUSB_ERROR_NO_MEM, IoError::transfer_failed}}) {
    Bench bench;
    LibusbLink link(bench.device());
    libusb_stand_in().submit_error = c.error;
    for (int i = 0; i < 5; ++i) CHECK(link.send(frame_of(1)).error == c.expected);
    CHECK(link.request().error == c.expected);
    CHECK_FALSE(link.answer_outstanding());
    libusb_stand_in().submit_error = 0;
    CHECK(link.send(frame_of(2)).ok());
    CHECK(link.request().ok());
  }
}

TEST_CASE("Recovery cancels queued transfers, clears both stalls and drops the board's old answers") {
  Bench bench;
  LibusbLink link(bench.device());
  auto& usb = libusb_stand_in();
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
  usb.submit_error = LIBUSB_ERROR_NO_DEVICE;
  link.recover();
  CHECK(usb.answers.size() == 5);
}

TEST_CASE("A board opened in lock-step has the emulator's time, and its control requests their errors") {
  Bench bench;
  {
    const Board board = open_board(bench.options(), true, true);
    CHECK(board.place == "04b4:1003 serial 77 at 1-1.4");
    REQUIRE(board.time);
    std::int64_t time_ns = -1;
    CHECK(board.time->advance_to(1'500'000).ok());
    CHECK(board.time->now(time_ns).ok());
    CHECK(time_ns == 1'500'000);
    for (const auto& [result, expected] :
         {std::pair{static_cast<int>(LIBUSB_ERROR_NO_DEVICE), IoError::disconnected},
          std::pair{static_cast<int>(LIBUSB_ERROR_PIPE), IoError::stalled}, std::pair{3, IoError::transfer_failed}}) {
      libusb_stand_in().control_result = result;
      CHECK(board.time->now(time_ns).error == expected);
      CHECK(time_ns == 1'500'000);
      CHECK(board.time->advance_to(2'000'000).error == expected);
    }
  }
  CHECK(bench.all_given_back());
}
