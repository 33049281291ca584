// Faults on the bus: the reason, the delay, and the outputs afterwards.

#include <linux/can/error.h>

#include "catch.hpp"
#include "driver/can/protocol.hpp"
#include "node_on_socket.hpp"

using namespace abs_hil;
using driver::can::Anomaly;
using driver::can::CanDriver;
using driver::can::CanOptions;
using rig::Reason;
using test::NodeOnSocket;

namespace {

constexpr std::int64_t ms = 1'000'000;
struct Active {
  explicit Active(bool fd = false, CanOptions options = {})
      : node({.start_speed_rad_s = 60.0}), driver(options, node.opener(fd), true) {
    driver.configure();
    driver.activate(0);
    for (int i = 0; i < 20; ++i) REQUIRE(cycle().ok());
    REQUIRE(node.wire().brake_duty == 0.5);
  }
  driver::IoResult cycle() {
    const driver::IoResult result = driver.read(now_ns += ms, measurement);
    return result.ok() ? driver.write({.brake_duty = 0.5}) : result;
  }
  /// Cycles until one fails; its result.
  driver::IoResult until_failure(int most_cycles) {
    driver::IoResult result{};
    for (cycles = 0; result.ok() && cycles < most_cycles; ++cycles) result = cycle();
    return result;
  }
  NodeOnSocket node;
  CanDriver driver;
  rig::Measurement measurement{};
  std::int64_t now_ns{0};
  int cycles{0};
};

can_frame error_frame(std::uint32_t kind, std::uint8_t controller = 0) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | kind;
  frame.can_dlc = CAN_ERR_DLC;
  frame.data[1] = controller;
  return frame;
}

}  // namespace

TEST_CASE("Each fault of the node ends with its reason once the bucket trips, and the brake is off") {
  struct Case {
    const char* fault;
    Reason reason;
    int cycles;     ///< at most
    int cycles_fd;  ///< one frame instead of two tells the same
  };
  const std::vector<Case> cases{{"silent", Reason::can_node_silent, 5, 5},
                                {"stale=20", Reason::can_frames_stale, 5, 5},
                                {"stuck", Reason::can_frames_duplicated, 3, 4},
                                {"ahead=3", Reason::can_frames_out_of_order, 2, 3},
                                {"duplicate", Reason::can_frames_duplicated, 10, 10},
                                {"wrong-size=7", Reason::can_frame_wrong_length, 2, 3},
                                {"wrong-size=0", Reason::can_frame_wrong_length, 2, 3},
                                {"corrupt", Reason::can_frames_forged, 2, 3},
                                {"nonsense", Reason::can_values_implausible, 3, 3},
                                {"babble=10", Reason::can_frames_forged, 1, 1}};
  for (const bool fd : {false, true}) {
    for (const Case& c : cases) {
      INFO(c.fault << (fd ? " with CAN FD" : ""));
      Active rig(fd);
      rig.node.fault(c.fault);
      const driver::IoResult result = rig.until_failure(50);
      CHECK_FALSE(result.ok());
      CHECK(result.reason == c.reason);
      CHECK(rig.cycles <= (fd ? c.cycles_fd : c.cycles));
      CHECK(rig.driver.state() == driver::DriverState::active);
      CHECK(rig.node.wire().brake_duty == 0.0);
    }
  }
}

TEST_CASE("A node that no longer reports its health or its outputs ends the run after 50 answers") {
  struct Case {
    const char* fault;
    Reason classic;
    Reason fd;  ///< the outputs stand in every answer
  };
  for (const Case& c : {Case{"no-status", Reason::board_health_lost, Reason::board_health_lost},
                        Case{"no-outputs", Reason::can_outputs_not_taken, Reason::none}}) {
    for (const bool fd : {false, true}) {
      INFO(c.fault << (fd ? " with CAN FD" : ""));
      Active rig(fd);
      rig.node.fault(c.fault);
      const driver::IoResult result = rig.until_failure(100);
      CHECK(result.reason == (fd ? c.fd : c.classic));
      CHECK(result.ok() == (c.fd == Reason::none && fd));
      CHECK((result.ok() || (rig.cycles > 40 && rig.cycles <= 60)));
      CHECK(rig.node.wire().brake_duty == (result.ok() ? 0.5 : 0.0));
    }
  }
}

TEST_CASE("Answers in the wrong order are reported") {
  Active rig;
  rig.node.fault("swapped");
  CHECK(rig.until_failure(20).reason == Reason::can_frames_out_of_order);
}

TEST_CASE("Single losses are tolerated: the previous measurement is returned again, with its time") {
  Active rig;
  const rig::Measurement before = rig.measurement;
  rig.node.fault("drop=4");
  for (int i = 0; i < 4; ++i) {
    REQUIRE(rig.cycle().ok());
    CHECK(rig.measurement.time_ns == before.time_ns);
    CHECK(rig.measurement.upper_counts == before.upper_counts);
  }
  for (int i = 0; i < 20; ++i) REQUIRE(rig.cycle().ok());
  CHECK(rig.measurement.time_ns == rig.now_ns);
  CHECK(rig.driver.counters().of(Anomaly::missing) == 4);
  CHECK(rig.node.wire().brake_duty == 0.5);
}

TEST_CASE("A loss of every third answer is tolerated for ever, of every second one not") {
  for (const int every : {3, 2}) {
    Active rig;
    driver::IoResult result{};
    for (int i = 0; i < 200 && result.ok(); ++i) {
      if (i % every == 0) rig.node.fault("drop=1");
      result = rig.cycle();
    }
    CHECK(result.ok() == (every == 3));
    if (every == 2) CHECK(result.reason == Reason::can_node_silent);
  }
}

TEST_CASE("The controller's states: bus-off and error-passive end the run at once, warnings and bus errors do not") {
  Active warned;
  warned.node.inject(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
  warned.node.inject(error_frame(CAN_ERR_PROT));
  CHECK(warned.cycle().ok());
  CHECK(warned.driver.counters().error_frames == 2);
  CHECK(warned.driver.counters().error_warnings == 1);

  Active passive;
  passive.node.inject(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE));
  CHECK(passive.cycle().reason == Reason::can_error_passive);

  Active off;
  off.node.inject(error_frame(CAN_ERR_BUSOFF));
  const driver::IoResult result = off.cycle();
  CHECK(result.reason == Reason::can_bus_off);
  CHECK(result.error == driver::IoError::disconnected);
}

TEST_CASE("A lost interface is reported, and so is the unconfirmed safe state") {
  Active rig;
  rig.node.hang_up();
  const driver::IoResult result = rig.cycle();
  CHECK(result.reason == Reason::can_interface_down);
  CHECK(rig.driver.deactivate().error == driver::IoError::disconnected);
}

TEST_CASE("A node that takes no commands latches by its watchdog, and that is reported") {
  Active rig;
  rig.node.fault("deaf");
  CHECK(rig.until_failure(50).reason == Reason::can_node_latched);
  CHECK(rig.cycles == 20);

  Active same;
  same.node.fault("no-status");
  for (int i = 0; i < 30; ++i) REQUIRE(same.cycle().ok());
}

TEST_CASE("A restart of the node during the run is reported") {
  Active rig;
  // Another node of the same kind takes over: powered on later, inactive.
  rig.node.with_node([](emulator::CanNode& node, emulator::NodeFaults&) {
    node = emulator::CanNode({.start_speed_rad_s = 60.0, .lock_step = true});
  });
  CHECK(rig.until_failure(5).reason == Reason::can_node_restarted);
  CHECK(rig.node.wire().brake_duty == 0.0);
}

TEST_CASE("Forged, repeated and old commands have no effect and do not feed the node's watchdog") {
  Active rig;
  emulator::BusFrame forged{.id = 0x81, .length = 8, .data = {0x10, 0x27}};
  emulator::BusFrame old = forged;  // its check is right, its sequence was used before
  old.seal();
  const std::int64_t commanded_ns = rig.now_ns;
  while (rig.now_ns - commanded_ns < 20 * ms) {
    CHECK(rig.node.wire().brake_duty == 0.5);
    rig.now_ns += ms;
    const bool answers = rig.driver.read(rig.now_ns, rig.measurement).ok();
    CHECK(answers == (rig.now_ns - commanded_ns < 20 * ms));
    if (rig.now_ns - commanded_ns == 15 * ms) {
      rig.node.send_to_node(forged);
      rig.node.send_to_node(old);
      CHECK(rig.node.with_node([](emulator::CanNode& n, emulator::NodeFaults&) { return n.rejected(); }) == 2);
    }
  }
  CHECK(rig.node.wire().brake_duty == 0.0);

  // A stream of them is an attack or a second host: the node cuts its outputs.
  Active attacked;
  for (int i = 0; i < 12; ++i) attacked.node.send_to_node(old);
  CHECK(attacked.node.wire().brake_duty == 0.0);
  CHECK(attacked.cycle().reason == Reason::can_node_latched);
}

TEST_CASE("Commands computed from old measurements do not feed the watchdog") {
  Active rig;
  // The driver hears nothing but goes on commanding, because its loss limit is high: the node itself must end that.
  Active patient(false, {.watchdog_ms = 20, .loss_limit = 1'000'000});
  patient.node.fault("silent");
  int cycles = 0;
  while (patient.node.wire().brake_duty > 0.0 && cycles < 60) {
    REQUIRE(patient.cycle().ok());
    ++cycles;
  }
  CHECK(cycles >= 8 + 9);   // 8 measurements old are allowed, then the node's bucket fills by 2 a command ...
  CHECK(cycles <= 8 + 20);  // ... or the watchdog ends it
}

TEST_CASE("Another sender's command ends the run in the next cycle, a question for the identity does not") {
  for (const bool fd : {false, true}) {
    for (const driver::can::Frame& frame :
         {driver::can::frame_of(driver::can::id::command, {.drive_duty = 5000, .drive_enable = 1}),
          driver::can::control_frame(driver::can::Request::activate),
          driver::can::control_frame(driver::can::Request::deactivate)}) {
      Active run(fd);
      run.node.send_as_other(frame);
      const driver::IoResult result = run.until_failure(5);
      CHECK(run.cycles == 1);
      CHECK(result.reason == Reason::foreign_writer);
      CHECK(result.where == frame.id);
      CHECK(run.node.wire().drive_duty == 0.0);
      CHECK(run.node.wire().brake_duty == 0.0);
    }
    Active asked(fd);
    asked.node.send_as_other(driver::can::control_frame(driver::can::Request::identify));
    CHECK(asked.until_failure(40).ok());
  }
}

TEST_CASE("Commands of another sender that only the node hears are found by the sequence that it names") {
  for (const bool fd : {false, true}) {
    Active run(fd);
    driver::IoResult result{};
    int cycles = 0;
    for (; result.ok() && cycles < 20; ++cycles) {
      // It is ahead of this program's sequence, so that the node takes its commands and refuses the others.
      const auto ahead = static_cast<std::uint8_t>(20 + cycles + 8);
      run.node.send_to_node(driver::can::frame_of(driver::can::id::command,
                                                  {.brake_duty = 5000, .heartbeat = 20 + cycles, .sequence = ahead}));
      result = run.cycle();
    }
    CAPTURE(fd, cycles);
    CHECK(result.reason == Reason::foreign_writer);
    CHECK(cycles <= (fd ? 1 : 10));
  }
}
