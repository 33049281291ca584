// The USB driver on the emulated board: channels, wraps, order of writes, versions.
#include "driver/usb/usb_driver.hpp"

#include <string>

#include "catch.hpp"
#include "driver/factory.hpp"
#include "model_board.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using Catch::Matchers::Contains;
using test::ModelBoard;
using usb::UsbOptions;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr double count_rev = 1.0 / 4096.0;
constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};

void start(RigDriver& driver) {
  driver.configure();
  driver.activate(0);
}

std::int64_t clock_ns = 0;
std::int64_t step_ns = 0;
std::int64_t stepping_clock() noexcept { return clock_ns += step_ns; }

}  // namespace

TEST_CASE("Encoders are taken from the channels configured, with their signs") {
  ModelBoard board({.lower_encoder = 5, .upper_encoder = 2});
  const auto own_driver = usb::usb_driver({.lower_channel = 5, .upper_channel = 2, .upper_sign = -1}, board.opener());
  driver::RigDriver& driver = *own_driver;
  start(driver);
  board.model.turn_by_hand(true, 10.5 * count_rev);
  board.model.turn_by_hand(false, 20.5 * count_rev);
  rig::Measurement measurement;
  REQUIRE(driver.read(ms, measurement).ok());
  CHECK(measurement.upper_counts == -10);
  CHECK(measurement.lower_counts == 20);
}

TEST_CASE("Counters continue across a wrap at 16, 31 and 32 bits") {
  const double start_counts = GENERATE(65530.0, 2147483640.0, 4294967290.0, -6.0);
  ModelBoard board;
  board.model.turn_by_hand(true, (start_counts + 0.5) * count_rev);
  const auto own_driver = usb::usb_driver({}, board.opener());
  driver::RigDriver& driver = *own_driver;
  start(driver);
  rig::Measurement measurement;
  for (int travelled = 1; travelled <= 20; ++travelled) {
    board.model.turn_by_hand(true, count_rev);
    REQUIRE(driver.read(travelled * ms, measurement).ok());
    REQUIRE(measurement.upper_counts == travelled);
  }
}

TEST_CASE("Drive and brake go to the PWMs configured; others keep what the board showed") {
  ModelBoard board({.drive_pwm = 4, .brake_pwm = 9});
  const auto own_first = usb::usb_driver({.drive_pwm = 2, .brake_pwm = 3}, board.opener());
  driver::RigDriver& first = *own_first;
  start(first);
  REQUIRE(first.write({.motor_duty = 1.0, .motor_enable = true}).ok());
  CHECK(board.model.outputs().drive_duty == 0.0);
  const auto own_driver = usb::usb_driver({.drive_pwm = 4, .brake_pwm = 9}, board.opener());
  driver::RigDriver& driver = *own_driver;
  start(driver);
  REQUIRE(driver.write(drive).ok());
  CHECK(std::abs(board.model.outputs().drive_duty - 0.5) < 1e-3);
  const auto image = board.model.image();
  CHECK(usb::word_at(image, 20 + 3 * 2 + 2) == 4095);  // the first driver's, which was left running
  REQUIRE(driver.write({.brake_duty = 1.0}).ok());
  CHECK(board.model.outputs().drive_duty == 0.0);
  CHECK(std::abs(board.model.outputs().brake_duty - 0.7) < 1e-3);  // the cap
  CHECK(board.model.nonsense() == 0);
}

TEST_CASE("The enable line is out, and on only while the motor is enabled") {
  const bool inverted = GENERATE(false, true);
  ModelBoard board({.enable_line = inverted ? -1 : 3});
  const auto own_driver = usb::usb_driver({.enable_line = 3, .enable_inverted = inverted}, board.opener());
  driver::RigDriver& driver = *own_driver;
  start(driver);
  const auto line = [&board] { return (usb::word_at(board.model.image(), 14) >> 3U & 1U) != 0; };
  CHECK(line() == inverted);
  REQUIRE(driver.write(drive).ok());
  CHECK(line() != inverted);
  CHECK(board.model.outputs().drive_duty > 0.4);
  CHECK(usb::word_at(board.model.image(), 12) == (0x7FFFU & ~8U));  // the other lines stay inputs
  REQUIRE(driver.write({.brake_duty = 0.5}).ok());
  CHECK(line() == inverted);
  REQUIRE(driver.write(drive).ok());
  CHECK(driver.deactivate().ok());
  CHECK(line() == inverted);
}

TEST_CASE("Mode and prescaler change only when the widths are 0") {
  ModelBoard board;
  const auto own_before = usb::usb_driver({.pwm_mode = "12-bit"}, board.opener());
  driver::RigDriver& before = *own_before;
  start(before);
  REQUIRE(before.write({.brake_duty = 0.1}).ok());  // 410 of 4095 would be all of 255
  // The next owner counts to 255: had it changed the mode first, the brake would have been fully on.
  const auto own_driver = usb::usb_driver({.pwm_mode = "8-bit", .pwm_prescaler = 44}, board.opener());
  driver::RigDriver& driver = *own_driver;
  const std::uint64_t frames = board.model.frames_taken();
  start(driver);
  CHECK(board.model.frames_taken() == frames + 2);
  CHECK(board.model.outputs().brake_duty == 0.0);
  CHECK(usb::word_at(board.model.image(), 23) == 44);
  CHECK(usb::word_at(board.model.image(), 24) == 0);
}

TEST_CASE("A measurement is stamped with the middle between request and answer") {
  ModelBoard board;
  clock_ns = 0;
  step_ns = 0;
  const auto own_driver = usb::usb_driver({}, board.opener(), stepping_clock);
  driver::RigDriver& driver = *own_driver;
  start(driver);
  clock_ns = 10 * ms;
  step_ns = 100'000;
  rig::Measurement measurement;
  REQUIRE(driver.read(10 * ms, measurement).ok());
  // Clock readings: deadline, asked, left, answered.
  CHECK(measurement.time_ns == 10 * ms + 300'000);
}

TEST_CASE("Another version word is refused before any output is written") {
  ModelBoard board({.version = 104});
  const auto own_driver = usb::usb_driver({.version = 103}, board.opener());
  driver::RigDriver& driver = *own_driver;
  CHECK_THROWS_WITH(driver.configure(), Contains("version word 104 is not the configured 103"));
  CHECK(board.model.frames_taken() == 0);
  const auto own_right = usb::usb_driver({.version = 104}, board.opener());
  driver::RigDriver& right = *own_right;
  right.configure();
  CHECK(right.state() == DriverState::inactive);
}

TEST_CASE("The driver's notes about the board name what is not known") {
  ModelBoard board;
  const auto own_driver = usb::usb_driver({}, board.opener());
  driver::RigDriver& driver = *own_driver;
  CHECK(driver.notes().empty());
  driver.configure();
  std::string notes;
  for (const std::string& note : driver.notes()) notes += note + '\n';
  CHECK_THAT(notes, Contains("version word 0x0067") && Contains("press the E-stop") &&
                        Contains("supply, temperature and interlocks are not known"));
  std::string inspection;
  for (const std::string& line : driver.inspection()) inspection += line + '\n';
  CHECK_THAT(inspection, Contains("encoder counters") && Contains("not known: the code of 0 V"));
  CHECK(board.model.frames_taken() == 0);
}

TEST_CASE("Options that contradict each other are named") {
  ModelBoard board;
  CHECK_THROWS_WITH(usb::usb_driver({.upper_sign = 0}, board.opener()), Contains("driver.usb.upper_sign = 0"));
  CHECK_THROWS_WITH(usb::usb_driver({.lower_channel = 1}, board.opener()), Contains("driver.usb.lower_channel"));
  CHECK_THROWS_WITH(usb::usb_driver({.brake_pwm = 0}, board.opener()), Contains("driver.usb.drive_pwm"));
}

TEST_CASE("The backend is marked as not verified on hardware until the configuration says otherwise") {
  driver::DriverOptions options{.kind = "usb"};
  CHECK_THAT(driver::verification_note(options), Contains("driver.kind=usb") && Contains("not verified on hardware"));
  options.verified_on_hardware = true;
  CHECK(driver::verification_note(options).empty());
}
