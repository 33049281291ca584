// How the guardian takes over a board that has one owner at a time, on the emulated CAN node and the emulated USB
// board: the owner drives and falls silent; the writer brings drive and brake to 0 and releases the board.

#include "catch.hpp"
#include "driver/can/node_on_socket.hpp"
#include "driver/usb/model_board.hpp"

using namespace abs_hil;

namespace {

constexpr std::int64_t ms = 1'000'000;

/// Runs the owner's cycle for a while and leaves it driving.
void drive(driver::RigDriver& owner, const rig::Command& command) {
  owner.configure();
  owner.activate(0);
  rig::Measurement measurement;
  for (std::int64_t now_ns = ms; now_ns <= 20 * ms; now_ns += ms) {
    REQUIRE(owner.read(now_ns, measurement).ok());
    REQUIRE(owner.write(command).ok());
  }
}

constexpr rig::Command driving{.motor_duty = 0.5, .motor_enable = true};
constexpr rig::Command braking{.brake_duty = 0.6};

}  // namespace

TEST_CASE("a CAN node whose owner fell silent is taken over and left safe") {
  for (const bool can_fd : {false, true}) {
    for (const rig::Command& command : {driving, braking}) {
      test::NodeOnSocket node({.start_speed_rad_s = 30.0});
      driver::can::CanDriver owner(driver::can::CanOptions{}, node.opener(can_fd), true);
      drive(owner, command);
      CHECK(node.wire().drive_duty + node.wire().brake_duty > 0.4);

      const auto writer = driver::can::safe_state_writer(node.opener(can_fd), true);
      writer->prepare();
      CHECK(node.wire().drive_duty + node.wire().brake_duty > 0.4);  // nothing is written beside an owner
      CHECK(writer->make_safe().ok());
      CHECK(node.wire().drive_duty == 0.0);
      CHECK(node.wire().brake_duty == 0.0);
      CHECK(writer->make_safe().ok());  // may be repeated
    }
  }
}

TEST_CASE("a CAN node counts as safe only once it answers") {
  test::NodeOnSocket node({.start_speed_rad_s = 30.0});
  driver::can::CanDriver owner(driver::can::CanOptions{.answer_timeout_us = 8'000}, node.opener(), true);
  drive(owner, driving);
  const auto writer = driver::can::safe_state_writer(node.opener(), true);
  writer->prepare();
  node.fault("silent");
  CHECK_FALSE(writer->make_safe().ok());
  node.fault("ok");
  CHECK(writer->make_safe().ok());
  CHECK(node.wire().drive_duty == 0.0);
}

TEST_CASE("a USB board whose owner fell silent is taken over and left safe") {
  for (const rig::Command& command : {driving, braking}) {
    test::ModelBoard board({.start_speed_rad_s = 30.0});
    const auto own_owner = driver::usb::usb_driver(driver::usb::UsbOptions{}, board.opener());
    driver::RigDriver& owner = *own_owner;
    drive(owner, command);
    const auto acting = [&board] { return board.model.outputs().drive_duty + board.model.outputs().brake_duty; };
    CHECK(acting() > 0.4);

    const auto writer = driver::usb::safe_state_writer(driver::usb::UsbOptions{}, board.opener());
    writer->prepare();
    CHECK(acting() > 0.4);
    board.unplugged = true;
    CHECK_FALSE(writer->make_safe().ok());
    board.unplugged = false;
    CHECK(writer->make_safe().ok());
    CHECK(acting() == 0.0);
    CHECK(writer->make_safe().ok());
  }
}
