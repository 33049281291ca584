// The safe state of a CAN node whose owner is gone.

#include "driver/can/can_safe_state.hpp"

#include "catch.hpp"
#include "node_on_socket.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using test::NodeOnSocket;

TEST_CASE("A node is told to deactivate without a handshake, and verified afterwards") {
  NodeOnSocket node{{}};
  can::CanSafeState writer{node.opener(), true};
  can::CanDriver owner({}, node.opener(), true);
  owner.configure();
  owner.activate(0);
  rig::Measurement measurement;
  REQUIRE(owner.read(1'000'000, measurement).ok());
  REQUIRE(owner.write({.motor_duty = 0.5, .brake_duty = 0.4, .motor_enable = true}).ok());
  REQUIRE(node.wire().drive_duty > 0.4);
  writer.prepare();
  CHECK(node.wire().drive_duty > 0.4);  // it prepares without a word to the node
  CHECK(writer.make_safe().ok());
  CHECK(node.wire().drive_duty == 0.0);
  CHECK(node.wire().brake_duty == 0.0);
  CHECK(writer.make_safe().ok());
  CHECK(writer.owner_needs_ns() == owner.make_safe_bound_ns());
}

TEST_CASE("A node whose answers do not come is zero all the same, but not verified") {
  NodeOnSocket node{{}};
  can::CanSafeState writer{node.opener(), true};
  can::CanDriver owner({}, node.opener(), true);
  owner.configure();
  owner.activate(0);
  rig::Measurement measurement;
  REQUIRE(owner.read(1'000'000, measurement).ok());
  REQUIRE(owner.write({.motor_duty = 0.5, .brake_duty = 0.4, .motor_enable = true}).ok());
  REQUIRE(node.wire().drive_duty > 0.4);
  node.fault("wrong-size=6");
  const IoResult unverified = writer.make_safe();
  CHECK(unverified.error == IoError::no_answer);
  CHECK(unverified.reason == rig::Reason::can_node_silent);
  CHECK(node.wire().drive_duty == 0.0);
  node.fault("ok");
  CHECK(writer.make_safe().ok());
}

TEST_CASE("Without a link there is nothing to verify, and the next try opens it again") {
  NodeOnSocket node{{}};
  bool down = true;
  const auto open = node.opener();
  can::CanSafeState writer{[&] { return down ? throw Unavailable("down") : open(); }, true};
  CHECK(writer.make_safe().error == IoError::disconnected);
  down = false;
  CHECK(writer.make_safe().ok());
}
