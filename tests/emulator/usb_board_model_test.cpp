// The emulated RT-DAC/USB2, by bytes laid out by hand from the facts: no line shared with the driver.

#include "emulator/usb_board_model.hpp"

#include <vector>

#include "catch.hpp"

using namespace abs_hil::emulator;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Taken = UsbBoardModel::Taken;

namespace {

using Frame = std::vector<std::uint8_t>;

Frame frame(std::initializer_list<std::pair<std::size_t, std::uint16_t>> words) {
  Frame bytes(504, 0);
  bytes[0] = 0x0F;
  bytes[1] = 0x8F;
  for (const auto& [word, value] : words) {
    bytes[2 * word] = static_cast<std::uint8_t>(value & 0xFFU);
    bytes[2 * word + 1] = static_cast<std::uint8_t>(value >> 8U);
  }
  return bytes;
}

std::uint16_t word(const UsbBoardModel::Image& image, std::size_t index) {
  return static_cast<std::uint16_t>(image[2 * index] | image[2 * index + 1] << 8U);
}

}  // namespace

TEST_CASE("PWM words act as duties of their mode; the E-stop cuts the drive only") {
  UsbBoardModel board({});
  CHECK(board.take(frame({{21, 2}, {22, 4095}, {24, 2}, {25, 2048}})) == Taken::frame);
  CHECK(board.outputs().drive_duty == 1.0);
  CHECK_THAT(board.outputs().brake_duty, WithinAbs(2048.0 / 4095.0, 1e-12));
  board.press_emergency_stop(true);
  CHECK(board.outputs().drive_duty == 0.0);
  CHECK(board.outputs().brake_duty > 0.5);
  board.press_emergency_stop(false);
  CHECK(board.take(frame({{22, 255}, {25, 51}})) == Taken::frame);
  CHECK(board.outputs().drive_duty == 1.0);
  CHECK_THAT(board.outputs().brake_duty, WithinAbs(0.2, 1e-12));
}

TEST_CASE("Nonsense changes nothing: lengths, marks, payload with bit 15") {
  UsbBoardModel board({});
  REQUIRE(board.take(frame({{21, 2}, {22, 1000}})) == Taken::frame);
  const auto before = board.image();
  Frame unmarked = frame({{22, 0}});
  unmarked[1] = 0;
  Frame too_wide = frame({{22, 0x8001}});
  Frame too_short = frame({});
  too_short.resize(500);
  for (const Frame& bytes : {unmarked, too_wide, too_short, Frame{}, Frame{0xFF, 0x8F, 0, 1}}) {
    CHECK(board.take(bytes) == Taken::nonsense);
  }
  CHECK(board.nonsense() == 5);
  CHECK(board.image() == before);
  CHECK(board.take(Frame{0xFF, 0x8F, 0, 0}) == Taken::request);
}

TEST_CASE("The motor accelerates the lower wheel; counters stand in their words, low one first") {
  UsbBoardModel board({.lower_encoder = 3, .upper_encoder = 6});
  REQUIRE(board.take(frame({{21, 2}, {22, 4095}})) == Taken::frame);
  board.advance_to(3'000'000'000);
  const auto image = board.image();
  const std::int64_t lower = word(image, 59) + 65536LL * word(image, 60);
  const std::int64_t upper = word(image, 65) + 65536LL * word(image, 66);
  const double counts = board.plant().state().angle2_rad / (2.0 * 3.14159265358979) * 4096.0;
  CHECK_THAT(static_cast<double>(lower), WithinAbs(counts, 1.0));
  CHECK(lower > 65536);
  CHECK(upper > 65536);
  CHECK(word(image, 53) == 0);
}

TEST_CASE("Without a host the outputs hold") {
  UsbBoardModel board({});
  REQUIRE(board.take(frame({{21, 2}, {22, 2000}, {24, 2}, {25, 1000}})) == Taken::frame);
  const Outputs before = board.outputs();
  board.advance_to(60'000'000'000);
  CHECK(board.outputs().drive_duty == before.drive_duty);
  CHECK(board.outputs().brake_duty == before.brake_duty);
}

TEST_CASE("The enable line") {
  UsbBoardModel board({.enable_line = 2});
  REQUIRE(board.take(frame({{12, 0x7FFF}, {14, 4}, {21, 2}, {22, 4095}})) == Taken::frame);
  CHECK(board.outputs().drive_duty == 0.0);  // high, but an input
  REQUIRE(board.take(frame({{12, 0x7FFB}, {14, 0}, {21, 2}, {22, 4095}})) == Taken::frame);
  CHECK(board.outputs().drive_duty == 0.0);
  REQUIRE(board.take(frame({{12, 0x7FFB}, {14, 4}, {21, 2}, {22, 4095}})) == Taken::frame);
  CHECK(board.outputs().drive_duty == 1.0);
}

TEST_CASE("Options and faults outside their range are refused") {
  CHECK_THROWS_WITH(UsbBoardModel({.drive_pwm = 1}), Contains("PWM channels 1 and 1"));
  CHECK_THROWS_WITH(UsbBoardModel({.upper_encoder = 8}), Contains("encoder channels"));
  CHECK_THROWS_WITH(UsbBoardModel({.enable_line = 15}), Contains("enable line 15"));
  CHECK_THROWS_WITH(UsbBoardModel({.start_speed_rad_s = -1.0}), Contains("start speed"));
  UsbFaults faults;
  for (const char* text : {"", "stall", "stall up", "length", "length -1", "length 513", "late", "late x", "ok ok"}) {
    CHECK_THROWS_WITH(faults.set(text), Contains("give ok, stall in|out"));
  }
  faults.set("late 2500 3");
  CHECK(faults.late_ns == 2'500'000);
  CHECK(faults.late_count == 3);
  faults.set("stall out once");
  CHECK(faults.stall_out == UsbFaults::Stall::once);
  faults.set("ok");
  CHECK(faults.late_ns == 0);
  CHECK(faults.stall_out == UsbFaults::Stall::none);
}
