// The CAN driver on the emulated node: counts, signs, caps, the node's watchdog and flags.
#include "driver/can/can_driver.hpp"

#include <numbers>

#include "catch.hpp"
#include "node_on_socket.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;
using driver::can::Anomaly;
using driver::can::CanDriver;
using driver::can::CanOptions;
using test::NodeOnSocket;

namespace {

constexpr std::int64_t ms = 1'000'000;

/// A driver, active on its node at 60 rad/s.
struct Active {
  explicit Active(CanOptions options = {}, bool fd = false, double speed_rad_s = 60.0)
      : node({.start_speed_rad_s = speed_rad_s}), driver(options, node.opener(fd), true) {
    driver.configure();
    driver.activate(0);
  }
  /// One cycle with a command, like that of a run.
  driver::IoResult cycle(const rig::Command& command = {}) {
    const driver::IoResult result = driver.read(now_ns += ms, measurement);
    return result.ok() ? driver.write(command) : result;
  }
  NodeOnSocket node;
  CanDriver driver;
  rig::Measurement measurement{};
  std::int64_t now_ns{0};
};

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  return text;
}

/// The socket pair as if it were the CAN interface of these facts.
driver::can::OpenLink as_interface(NodeOnSocket& node, driver::can::InterfaceFacts facts) {
  return [open = node.opener(), facts = std::move(facts)] {
    driver::can::Link link = open();
    link.facts = facts;
    return link;
  };
}

}  // namespace

TEST_CASE("Counts continue across the wrap of the node's counters") {
  constexpr std::int32_t per_rev = 1'000'000;  // the 24 bits wrap in 0.6 s
  emulator::BoardOptions options{.start_speed_rad_s = 170.0};
  options.plant.rig.encoder_counts_per_rev = per_rev;
  for (const bool fd : {false, true}) {
    NodeOnSocket node(options);
    CanDriver driver({.encoder_counts_per_rev = per_rev}, node.opener(fd), true);
    driver.configure();
    driver.activate(0);
    rig::Measurement measurement;
    for (std::int64_t now_ns = ms; now_ns <= 800 * ms; now_ns += ms) REQUIRE(driver.read(now_ns, measurement).ok());
    const double turned_rad =
        node.with_node([](emulator::CanNode& n, emulator::NodeFaults&) { return n.plant().state().angle1_rad; });
    const double counts = turned_rad / (2.0 * std::numbers::pi) * per_rev;
    CHECK(counts > (1 << 24));
    CHECK(std::abs(measurement.upper_counts - counts) <= 1.0);
  }
}

TEST_CASE("A sign of -1 negates the counter") {
  Active forward;
  Active backward({.lower_sign = -1, .upper_sign = -1});
  for (int i = 0; i < 20; ++i) {
    REQUIRE(forward.cycle().ok());
    REQUIRE(backward.cycle().ok());
  }
  CHECK(forward.measurement.upper_counts > 500);
  CHECK(backward.measurement.upper_counts == -forward.measurement.upper_counts);
  CHECK(backward.measurement.lower_counts == -forward.measurement.lower_counts);
}

TEST_CASE("The brake's cap holds on the wire; the drive only while enabled") {
  Active rig;
  REQUIRE(rig.cycle({.brake_duty = 1.0}).ok());
  CHECK(rig.node.wire().brake_duty == 0.7);
  REQUIRE(rig.cycle({.motor_duty = 1.0}).ok());
  CHECK(rig.node.wire().drive_duty == 0.0);
  REQUIRE(rig.cycle({.motor_duty = 1.0, .motor_enable = true}).ok());
  CHECK(rig.node.wire().drive_duty == 1.0);
}

TEST_CASE("The node's watchdog zeroes the outputs when commands stop, and only a new activation clears it") {
  Active rig({.watchdog_ms = 20});
  REQUIRE(rig.cycle({.brake_duty = 0.5}).ok());
  const auto since_command_ns = [&] { return rig.now_ns; };
  const std::int64_t commanded_ns = since_command_ns();
  driver::IoResult result{};
  while (result.ok() && rig.now_ns < 100 * ms) {
    CHECK((rig.node.wire().brake_duty == 0.5) == (rig.now_ns - commanded_ns < 20 * ms));
    result = rig.driver.read(rig.now_ns += ms, rig.measurement);
  }
  CHECK(rig.now_ns - commanded_ns == 20 * ms);
  CHECK(result.reason == rig::Reason::can_node_latched);
  CHECK(rig.node.wire().brake_duty == 0.0);
  // Commands alone do not end the latched state.
  for (int i = 0; i < 5; ++i) {
    CHECK(rig.driver.write({.brake_duty = 0.5}).ok());
    CHECK(rig.driver.read(rig.now_ns += ms, rig.measurement).reason == rig::Reason::can_node_latched);
  }
  CHECK(rig.node.wire().brake_duty == 0.0);
  CHECK(rig.driver.deactivate().ok());
  rig.driver.activate(rig.now_ns);
  REQUIRE(rig.cycle({.brake_duty = 0.5}).ok());
  CHECK(rig.node.wire().brake_duty == 0.5);
}

TEST_CASE("The node's supply, temperature and trip flags reach the measurement") {
  Active rig;
  rig.node.with_node([](emulator::CanNode& node, emulator::NodeFaults&) {
    node.set_supply_V(11.0);
    node.set_temperature_C(65.0);
  });
  for (int i = 0; i < 11; ++i) static_cast<void>(rig.cycle());
  CHECK_THAT(rig.measurement.supply_V, Catch::Matchers::WithinAbs(11.0, 1e-3));
  CHECK_THAT(rig.measurement.temperature_C, Catch::Matchers::WithinAbs(65.0, 1e-2));
  CHECK(rig.measurement.trip_flags == rig::trip::supply);
}

TEST_CASE("An invalid option is refused with its key") {
  using Catch::Matchers::Contains;
  const auto made = [](const CanOptions& options) {
    CanDriver(
        options, [] { return driver::can::Link{}; }, false);
  };
  CHECK_THROWS_WITH(made({.upper_sign = 0}), Contains("driver.can.upper_sign = 0"));
  CHECK_THROWS_WITH(made({.answer_timeout_us = 801}), Contains("at most 800 us"));
  CHECK_NOTHROW(made({.answer_timeout_us = 800}));
}

TEST_CASE("A node in the wrong time mode (lock-step or real time) is refused; nothing is written") {
  NodeOnSocket node({});
  CanDriver real_time({}, node.opener(), false);
  CHECK_THROWS_WITH(real_time.configure(), Catch::Matchers::Contains("emulator in lock-step"));
  CHECK(node.with_node([](emulator::CanNode& n, emulator::NodeFaults&) { return n.writes(); }) == 0);
}

TEST_CASE("A silent node is reported at configure and at activation") {
  NodeOnSocket node({});
  CanDriver rig({}, node.opener(), true);
  node.fault("silent");
  CHECK_THROWS_WITH(rig.configure(), Catch::Matchers::Contains("no node answers"));
  node.fault("ok");
  rig.configure();
  node.fault("silent");
  CHECK_THROWS_AS(rig.activate(0), driver::Unavailable);
  CHECK(rig.state() == driver::DriverState::inactive);
}

TEST_CASE("A bus too slow for the rate of the cycle is refused; one that carries it has its load in the notes") {
  NodeOnSocket node({});
  // A cycle's frames take more than 500 bits at worst and less than 1000.
  CanDriver slow({}, as_interface(node, {.name = "nowhere0", .bit_rate = 500'000}), true);
  CHECK_THROWS_WITH(slow.configure(), Contains("500000 bit/s cannot carry 1000 cycles a second") &&
                                          Contains("raise the bit rate, use CAN FD or lower --rate"));
  CanDriver good({}, as_interface(node, {.name = "nowhere0", .bit_rate = 1'000'000}), true);
  good.configure();
  CHECK_THAT(good.notes().at(1), Contains("bus load") && !Contains("the interface has no bit rate"));
}

TEST_CASE("If the interface is gone, the interface is the reason and not the silent node") {
  NodeOnSocket node({.start_speed_rad_s = 60.0});
  CanDriver driver({}, as_interface(node, {.name = "nowhere0", .bit_rate = 1'000'000}), true);
  driver.configure();
  driver.activate(0);
  node.fault("silent");
  rig::Measurement measurement;
  driver::IoResult result{};
  for (std::int64_t now_ns = ms; result.ok() && now_ns < 20 * ms; now_ns += ms) {
    result = driver.read(now_ns, measurement);
  }
  CHECK(result.error == driver::IoError::disconnected);
  CHECK(result.reason == rig::Reason::can_interface_down);
}

TEST_CASE("A missing socket is refused with the fix") {
  const auto opening = [](const std::string& path) { return driver::can::open_link({.interface = "unix:" + path}); };
  CHECK_THROWS_WITH(opening(""), Contains("give a path of 1 to 107 characters"));
  CHECK_THROWS_WITH(opening(std::string(108, 'x')), Contains("give a path of 1 to 107 characters"));
  CHECK_THROWS_WITH(opening("/nowhere/node"), Contains("No such file") && Contains("start abs_rig_emulator --can"));
}

TEST_CASE("Inspection asks a node that stays inactive, and reports its silence") {
  NodeOnSocket node({.start_speed_rad_s = 60.0});
  CanDriver driver({}, node.opener(), true);
  driver.configure();
  const std::string told = joined(driver.inspection());
  CHECK_THAT(told, Contains("counters: upper wheel") && Contains("state inactive") && Contains("trip flags 0x0"));
  CHECK(node.with_node([](emulator::CanNode& n, emulator::NodeFaults&) { return n.state(); }) ==
        emulator::CanNode::State::inactive);
  node.fault("silent");
  CHECK_THAT(joined(driver.inspection()), Contains("no answer to a SYNC") && !Contains("counters:"));
}

TEST_CASE("The tally is one line after a good run, and lists the anomalies of another") {
  Active good;
  for (int i = 0; i < 20; ++i) REQUIRE(good.cycle().ok());
  CHECK(good.driver.tally().size() == 1);

  Active odd;
  odd.node.fault("wrong-size=7");
  while (odd.cycle().ok()) {
  }
  const std::string told = joined(odd.driver.tally());
  const std::uint64_t wrong = odd.driver.counters().of(Anomaly::wrong_length);
  CHECK(wrong > 0);
  CHECK_THAT(told, Contains(std::to_string(wrong) + " of wrong length"));
  CHECK_THAT(told, Contains("0 stale, 0 duplicate, 0 out of order") && Contains("0 times the send queue was full"));
}
