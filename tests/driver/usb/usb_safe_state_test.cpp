// The safe state of a USB board whose owner is gone, whatever has become of its answers.

#include "abs_hil/driver/io_result.hpp"
#include "catch.hpp"
#include "model_board.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using Stall = emulator::UsbFaults::Stall;
using test::ModelBoard;

namespace {

/// A board that an owner has left with drive and brake on.
struct Left {
  explicit Left(const usb::UsbOptions& options = {}, const emulator::BoardOptions& board_options = {})
      : board(board_options), writer(usb::safe_state_writer(options, board.opener())) {
    const auto own_owner = usb::usb_driver(options, board.opener());
    driver::RigDriver& owner = *own_owner;
    owner.configure();
    owner.activate(0);
    rig::Measurement measurement;
    REQUIRE(owner.read(1'000'000, measurement).ok());
    REQUIRE(owner.write({.motor_duty = 0.5, .brake_duty = 0.4, .motor_enable = true}).ok());
    held = board.model.image();
    static_cast<void>(owner.deactivate());
    // The owner's destructor has no say in this: the outputs are as they were when it died.
    usb::Frame frame = usb::frame_from(std::span(held).first<usb::frame_bytes>());
    static_cast<void>(board.model.take(frame));
    REQUIRE(board.model.outputs().drive_duty > 0.4);
    REQUIRE(board.model.outputs().brake_duty > 0.3);
  }
  [[nodiscard]] bool safe() const {
    const emulator::Outputs out = board.model.outputs();
    return out.drive_duty == 0.0 && out.brake_duty == 0.0;
  }

  ModelBoard board;
  emulator::UsbBoardModel::Image held{};
  std::unique_ptr<SafeStateWriter> writer;
};

}  // namespace

TEST_CASE("A board that answers is zero and verified at the first try") {
  Left left;
  left.writer->prepare();
  CHECK(left.writer->make_safe().ok());
  CHECK(left.safe());
  CHECK(left.board.recoveries == 0);
}

TEST_CASE("Zeros go out at the first try although no answer comes, and count as verified only once one does") {
  Left left;
  SECTION("silent") { left.board.faults.silent = true; }
  SECTION("dead IN endpoint") { left.board.faults.stall_in = Stall::on; }
  SECTION("garbage") { left.board.faults.garbage = true; }
  SECTION("cut answers") { left.board.faults.length = 100; }
  CHECK_FALSE(left.writer->make_safe().ok());
  CHECK(left.safe());
  left.board.faults = {};
  CHECK(left.writer->make_safe().ok());
  CHECK(left.safe());
}

TEST_CASE("A board that takes frames only after a recovery gets its zeros at the first try") {
  Left left;
  left.board.faults.stall_out = Stall::once;
  CHECK_FALSE(left.writer->make_safe().ok());
  CHECK(left.safe());
  CHECK(left.writer->make_safe().ok());
}

TEST_CASE("Words that are not of the rig keep the board's values, and lines of a board that shows none become inputs") {
  const usb::UsbOptions options{.enable_line = 3};
  Left left(options, {.enable_line = 3});
  SECTION("shown") {
    CHECK(left.writer->make_safe().ok());
    const auto image = left.board.model.image();
    CHECK(usb::word_at(image, usb::word::digital_direction) == usb::word_at(left.held, usb::word::digital_direction));
  }
  SECTION("silent") {
    left.board.faults.silent = true;
    CHECK_FALSE(left.writer->make_safe().ok());
    const auto image = left.board.model.image();
    CHECK(usb::word_at(image, usb::word::digital_direction) == (usb::payload_bits & ~(1U << 3U)));
    CHECK((usb::word_at(image, usb::word::digital_out) & (1U << 3U)) == 0);
  }
  CHECK(left.safe());
}

TEST_CASE("A board that is gone is opened again when it is back") {
  Left left;
  left.board.unplugged = true;
  for (int i = 0; i < 3; ++i) CHECK(left.writer->make_safe().error == IoError::disconnected);
  CHECK_FALSE(left.safe());
  left.board.unplugged = false;
  CHECK(left.writer->make_safe().ok());
  CHECK(left.safe());
}

TEST_CASE("A look sends the board no frame while its outputs are zero, and zeros if they are not") {
  Left left;
  REQUIRE(left.writer->make_safe().ok());
  const std::uint64_t taken = left.board.model.frames_taken();
  CHECK(left.writer->verify_safe().ok());
  CHECK(left.board.model.frames_taken() == taken);
  usb::Frame frame = usb::frame_from(std::span(left.held).first<usb::frame_bytes>());
  static_cast<void>(left.board.model.take(frame));
  REQUIRE_FALSE(left.safe());
  const IoResult found = left.writer->verify_safe();
  CHECK(found.error == IoError::foreign_writer);
  CHECK(found.reason == rig::Reason::foreign_writer);
  CHECK(left.safe());
  CHECK(left.writer->verify_safe().ok());
}

TEST_CASE("A look at a board that is silent, that does not show its outputs or was never opened sends zeros") {
  SECTION("silent") {
    Left left;
    REQUIRE(left.writer->make_safe().ok());
    left.board.faults.silent = true;
    CHECK(left.writer->verify_safe().error == IoError::no_answer);
    CHECK(left.safe());
  }
  SECTION("does not show them") {
    Left left({.verify_outputs = false});
    CHECK(left.writer->verify_safe().ok());
    CHECK(left.safe());
  }
  SECTION("never opened") {
    Left left;
    CHECK(left.writer->verify_safe().ok());
    CHECK(left.safe());
  }
}
