// Faults of board and cable: the driver's error, and the outputs afterwards.

#include "catch.hpp"
#include "driver/usb/usb_driver.hpp"
#include "model_board.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using Catch::Matchers::Contains;
using rig::Reason;
using test::ModelBoard;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};

struct Running {
  explicit Running(const usb::UsbOptions& options = {}) : own(usb::usb_driver(options, board.opener())), driver(*own) {
    driver.configure();
    driver.activate(0);
    REQUIRE(cycle().ok());
    REQUIRE(driver.write(drive).ok());
    REQUIRE(board.model.outputs().drive_duty > 0.4);
  }
  IoResult cycle() { return driver.read(++now_ms * ms, measurement); }
  [[nodiscard]] bool safe() const {
    const emulator::Outputs out = board.model.outputs();
    return out.drive_duty == 0.0 && out.brake_duty == 0.0;
  }

  ModelBoard board{{.start_speed_rad_s = 60.0}};
  std::unique_ptr<RigDriver> own;
  RigDriver& driver;
  std::int64_t now_ms{0};
  rig::Measurement measurement{};
};

}  // namespace

TEST_CASE("A cycle without its frame keeps the previous measurement with its time stamp") {
  Running run;
  const rig::Measurement before = run.measurement;
  run.board.late_waits = 1;
  REQUIRE(run.cycle().ok());
  CHECK(run.measurement.time_ns == before.time_ns);
  CHECK(run.measurement.upper_counts == before.upper_counts);
  CHECK(run.driver.tally() == std::vector<std::string>{"USB board: 1 cycles without their frame"});
}

TEST_CASE("A late answer does not count as the answer of the cycle in which it arrives") {
  Running run;
  run.board.late_waits = 1;
  REQUIRE(run.cycle().ok());  // asked at 2 ms, nothing yet
  REQUIRE(run.cycle().ok());  // the answer of 2 ms is there, and dropped; that of 3 ms is taken
  CHECK(run.measurement.time_ns == 3 * ms);
  // 60 rad/s are 39 counts a ms: those of 3 ms since activation at 0.
  CHECK(std::abs(run.measurement.upper_counts - 117) <= 2);
  CHECK(run.driver.tally() == std::vector<std::string>{"USB board: 1 cycles without their frame"});
}

TEST_CASE("Four cycles without a frame pass, the fifth is a fault; commands go on reaching the board") {
  Running run;
  run.board.faults.silent = true;
  for (int i = 0; i < 4; ++i) {
    REQUIRE(run.cycle().ok());
    REQUIRE(run.driver.write({.brake_duty = 0.5}).ok());
  }
  CHECK(run.board.model.outputs().brake_duty > 0.4);
  const IoResult result = run.cycle();
  CHECK(result.error == IoError::no_answer);
  CHECK(result.reason == Reason::usb_no_answer);
  CHECK(run.driver.write(rig::safe_command).ok());
  CHECK(run.safe());
  // It takes frames and answers none: the outputs are safe, and nobody can know.
  CHECK(run.driver.deactivate().error == IoError::no_answer);
}

TEST_CASE("A board that takes no more frames is found even without reads") {
  Running run;
  run.board.slow_sends = 100;
  for (int i = 0; i < 4; ++i) REQUIRE(run.driver.write({.brake_duty = 0.5}).ok());
  const IoResult result = run.driver.write({.brake_duty = 0.5});
  CHECK(result.reason == Reason::usb_no_answer);
  CHECK(run.driver.state() == DriverState::failed);
}

TEST_CASE("A frame that the board did not take is no mismatch: the board still shows the previous one") {
  Running run;
  run.board.slow_sends = 1;
  REQUIRE(run.driver.write({.brake_duty = 0.5}).ok());
  CHECK(run.cycle().ok());
  REQUIRE(run.driver.write({.brake_duty = 0.5}).ok());
  CHECK(run.board.model.outputs().brake_duty > 0.4);
  CHECK(run.cycle().ok());
}

TEST_CASE("Unplugged: found at once, read or written; the safe state is not known to have arrived, the outputs hold") {
  Running run;
  run.board.unplugged = true;
  const bool reading = GENERATE(true, false);
  const IoResult result = reading ? run.cycle() : run.driver.write(rig::safe_command);
  CHECK(result.error == IoError::disconnected);
  CHECK(result.reason == Reason::usb_unplugged);
  CHECK(run.driver.deactivate().error == IoError::disconnected);
  CHECK(run.board.model.outputs().drive_duty > 0.4);  // no watchdog: this is why the words name the E-stop
  CHECK_THAT(std::string(rig::description(result.reason)), Contains("press the E-stop"));
}

TEST_CASE("A STALL is a fault; cleared, it does not keep the safe state from the board") {
  Running run;
  using enum emulator::UsbFaults::Stall;
  SECTION("IN") {
    run.board.faults.stall_in = once;
    CHECK(run.cycle().reason == Reason::usb_stalled);
  }
  SECTION("OUT, found writing") {
    run.board.faults.stall_out = once;
    CHECK(run.driver.write(drive).reason == Reason::usb_stalled);
    CHECK(run.driver.state() == DriverState::failed);
  }
  CHECK(run.driver.deactivate().ok());
  CHECK(run.board.recoveries >= 1);
  CHECK(run.safe());
}

TEST_CASE("With a permanent STALL of IN the safe state reaches the board but cannot be verified") {
  Running run;
  run.board.faults.stall_in = emulator::UsbFaults::Stall::on;
  CHECK(run.cycle().reason == Reason::usb_stalled);
  CHECK(run.driver.deactivate().error == IoError::stalled);
  CHECK(run.safe());
}

TEST_CASE("A frame of the wrong length, and random bytes") {
  Running run;
  SECTION("short") {
    run.board.faults.length = GENERATE(0U, 4U, 503U);
    const IoResult result = run.cycle();
    CHECK(result.error == IoError::incomplete_answer);
    CHECK(result.reason == Reason::usb_short_frame);
  }
  SECTION("long") {
    run.board.faults.length = 512;
    CHECK(run.cycle().reason == Reason::usb_short_frame);
  }
  SECTION("garbage") {
    run.board.faults.garbage = true;
    const IoResult result = run.cycle();
    CHECK(result.error == IoError::implausible_answer);
    CHECK(result.reason == Reason::usb_not_a_frame);
  }
  SECTION("a counter faster than any wheel") {
    run.board.model.turn_by_hand(true, 1.0);
    CHECK(run.cycle().reason == Reason::usb_not_a_frame);
  }
  CHECK(run.driver.write(rig::safe_command).ok());
  CHECK(run.safe());
}

TEST_CASE("An output that is not shown as it was sent is found with the next frame") {
  Running run;
  run.board.model.break_brake(true);
  REQUIRE(run.driver.write({.brake_duty = 0.5}).ok());
  CHECK(run.cycle().reason == Reason::usb_outputs_not_taken);
  CHECK(run.driver.deactivate().error == IoError::read_back_mismatch);
}

TEST_CASE("A board that does not show its outputs: refused with the key, or run without verification") {
  ModelBoard board({.shows_outputs = false});
  const auto own_strict = usb::usb_driver({}, board.opener());
  driver::RigDriver& strict = *own_strict;
  strict.configure();
  CHECK_THROWS_WITH(strict.activate(0),
                    Contains("taking over the outputs failed") && Contains("set driver.usb.verify_outputs=false"));
  CHECK(board.model.outputs().drive_duty == 0.0);
  const auto own_trusting = usb::usb_driver({.verify_outputs = false}, board.opener());
  driver::RigDriver& trusting = *own_trusting;
  trusting.configure();
  trusting.activate(0);
  rig::Measurement measurement;
  REQUIRE(trusting.write(drive).ok());
  CHECK(board.model.outputs().drive_duty > 0.4);
  REQUIRE(trusting.read(ms, measurement).ok());
  CHECK(trusting.deactivate().ok());
  CHECK(board.model.outputs().drive_duty == 0.0);
  CHECK_THAT(trusting.notes()[3], Contains("not verified"));
}

TEST_CASE("A board whose first frame is invalid or missing is refused") {
  ModelBoard board;
  const auto own_driver = usb::usb_driver({}, board.opener());
  driver::RigDriver& driver = *own_driver;
  SECTION("short") {
    board.faults.length = 64;
    CHECK_THROWS_WITH(driver.configure(), Contains("has 64 bytes, not 504"));
  }
  SECTION("silent") {
    board.faults.silent = true;
    CHECK_THROWS_WITH(driver.configure(), Contains("first frame did not come") && Contains("did not answer"));
  }
  CHECK(driver.state() == DriverState::unconfigured);
  CHECK(board.model.frames_taken() == 0);
}
