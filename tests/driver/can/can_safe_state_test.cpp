// The safe state of a CAN node whose owner is gone.

#include "catch.hpp"
#include "driver/can/can_driver.hpp"
#include "node_on_socket.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using test::NodeOnSocket;

TEST_CASE("A node is told to deactivate without a handshake, and verified afterwards") {
  NodeOnSocket node{{}};
  const auto writer = can::safe_state_writer(node.opener(), true);
  can::CanDriver owner({}, node.opener(), true);
  owner.configure();
  owner.activate(0);
  rig::Measurement measurement;
  REQUIRE(owner.read(1'000'000, measurement).ok());
  REQUIRE(owner.write({.motor_duty = 0.5, .brake_duty = 0.4, .motor_enable = true}).ok());
  REQUIRE(node.wire().drive_duty > 0.4);
  writer->prepare();
  CHECK(node.wire().drive_duty > 0.4);  // it prepares without a word to the node
  CHECK(writer->make_safe().ok());
  CHECK(node.wire().drive_duty == 0.0);
  CHECK(node.wire().brake_duty == 0.0);
  CHECK(writer->make_safe().ok());
  CHECK(writer->owner_needs_ns() == owner.make_safe_bound_ns());
}

TEST_CASE("A node whose answers do not come is zero all the same, but not verified") {
  NodeOnSocket node{{}};
  const auto writer = can::safe_state_writer(node.opener(), true);
  can::CanDriver owner({}, node.opener(), true);
  owner.configure();
  owner.activate(0);
  rig::Measurement measurement;
  REQUIRE(owner.read(1'000'000, measurement).ok());
  REQUIRE(owner.write({.motor_duty = 0.5, .brake_duty = 0.4, .motor_enable = true}).ok());
  REQUIRE(node.wire().drive_duty > 0.4);
  node.fault("wrong-size=6");
  const IoResult unverified = writer->make_safe();
  CHECK(unverified.error == IoError::no_answer);
  CHECK(unverified.reason == rig::Reason::can_node_silent);
  CHECK(node.wire().drive_duty == 0.0);
  node.fault("ok");
  CHECK(writer->make_safe().ok());
}

TEST_CASE("Without a link there is nothing to verify, and the next try opens it again") {
  NodeOnSocket node{{}};
  bool down = true;
  const auto open = node.opener();
  const auto writer = can::safe_state_writer([&] { return down ? throw Unavailable("down") : open(); }, true);
  CHECK(writer->make_safe().error == IoError::disconnected);
  down = false;
  CHECK(writer->make_safe().ok());
}

TEST_CASE("A look at an inactive node commands nothing; an active one is something else's and is deactivated") {
  NodeOnSocket node{{}};
  const auto writer = can::safe_state_writer(node.opener(), false);
  writer->prepare();
  REQUIRE(writer->make_safe().ok());
  const auto writes = [&] {
    return node.with_node([](emulator::CanNode& n, emulator::NodeFaults&) { return n.writes(); });
  };
  const std::uint64_t before = writes();
  for (int i = 0; i < 300; ++i) REQUIRE(writer->verify_safe().ok());  // the sequence wraps
  CHECK(writes() == before);
  {
    can::CanDriver other({}, node.opener(), true);
    other.configure();
    other.activate(0);
    rig::Measurement measurement;
    REQUIRE(other.read(1'000'000, measurement).ok());
    REQUIRE(other.write({.motor_duty = 0.5, .motor_enable = true}).ok());
    REQUIRE(node.wire().drive_duty > 0.4);
    const IoResult found = writer->verify_safe();
    CHECK(found.error == IoError::foreign_writer);
    CHECK(found.reason == rig::Reason::foreign_writer);
    CHECK(node.wire().drive_duty == 0.0);
  }
  REQUIRE(writer->make_safe().ok());
  CHECK(writer->verify_safe().ok());
  // A command that the inactive node refuses still shows that somebody sends them.
  node.send_as_other(can::frame_of(can::id::command, {.drive_duty = 5000, .drive_enable = 1}));
  CHECK(writer->verify_safe().error == IoError::foreign_writer);
  node.fault("silent");
  CHECK(writer->verify_safe().error == IoError::no_answer);
}
