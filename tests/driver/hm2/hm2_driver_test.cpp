// What the driver does on a board that works: datagrams, counts, ages of edges, rest, lines, what it tells.

#include "active_rig.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::test;
using Catch::Matchers::Contains;
using rig::Reason;

TEST_CASE("The cycle's datagrams have the sizes of docs/hm2.md") {
  std::vector<std::size_t> sizes;
  std::size_t answer = 0;
  Rig rig;
  rig.cable.loses_request = [&](const auto& request) {
    sizes.push_back(request.size());
    return false;
  };
  rig.cable.loses_answer = [&](const auto& bytes) {
    answer = bytes.size();
    return false;
  };
  REQUIRE(rig.cycle(drive).ok());
  CHECK(sizes == std::vector<std::size_t>{44, 40});
  CHECK(answer == 54);
}

TEST_CASE("16-bit counts are extended over their wrap, in both directions and with either sign") {
  for (const std::int32_t sign : {1, -1}) {
    Rig rig({.upper_sign = sign}, 170.0);
    REQUIRE(rig.cycles(1, rig::safe_command).ok());
    const std::int32_t first = rig.measurement.upper_counts;
    REQUIRE(rig.cycles(2000, rig::safe_command).ok());
    const double turns = sign * (rig.measurement.upper_counts - first) / 4096.0;
    CHECK(turns > 45.0);  // 170 rad/s for 2 s, less the bearings' friction
    CHECK(turns < 54.2);
  }
}

TEST_CASE("At rest the outputs are off and reading goes on; another program's looks are no fault then") {
  Rig rig({}, 50.0);
  REQUIRE(rig.cycles(10, drive).ok());
  REQUIRE(rig.cycle(rig::safe_command).ok());
  REQUIRE(rig.driver.rest().ok());
  CHECK(rig.board.ddr() == std::array<std::uint32_t, 2>{0, 0});
  const std::int32_t before = rig.measurement.lower_counts;
  for (int i = 0; i < 100; ++i) {
    rig.board.advance_to(rig.now_ns += ms);
    rig.board.handle(std::array<std::uint8_t, 4>{0x81, 0x42, 0x00, 0x11});
    REQUIRE(rig.driver.read(rig.now_ns, rig.measurement).ok());
  }
  CHECK(rig.measurement.lower_counts > before + 1000);
  REQUIRE(rig.cycles(2, drive).ok());
  CHECK(rig.is_on());
}

TEST_CASE("Faults of the board have reasons of their own and drop the outputs at once") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  Reason expected = Reason::none;
  SECTION("another program reads") {
    rig.board.handle(std::array<std::uint8_t, 4>{0x81, 0x42, 0x00, 0x11});
    expected = Reason::foreign_writer;
  }
  SECTION("another program leaves its number") {
    rig.board.handle(std::array<std::uint8_t, 8>{0x82, 0xD1, 0x14, 0, 77, 0, 0, 0});
    rig.board.forget_last_packet();
    expected = Reason::foreign_writer;
  }
  SECTION("quadrature error") {
    rig.board.control[1] = 0x8000;
    expected = Reason::hm2_quadrature_error;
  }
  SECTION("its supply failed for a moment") {
    rig.board.restart();
    expected = Reason::hm2_restarted;
  }
  SECTION("a pin is no output any more") {
    rig.board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x11, 0, 0, 0, 0});
    rig.board.forget_last_packet();
    expected = Reason::hm2_outputs_off;
  }
  SECTION("counts jump") {
    rig.board.time_jump_counts = 5000;
    expected = Reason::hm2_values_implausible;
  }
  const IoResult result = rig.cycle(drive);
  CHECK(result.reason == expected);
  CHECK_FALSE(rig.is_on());
  CHECK(rig.driver.deactivate().ok());
}

TEST_CASE("The ages of the encoders' edges are the board's, to its tick of 0.5 us, also while a wheel stands") {
  Rig rig({}, 3.0);
  std::int32_t oldest_ns = 0;
  int cycles = 0;
  int unknown = 0;
  // A stamp of 16 bits wraps after 33 ms.
  for (; oldest_ns < 200 * ms && cycles < 6000; ++cycles) {
    REQUIRE(rig.cycle(rig::safe_command).ok());
    for (const bool upper : {false, true}) {
      const std::int32_t age_ns = upper ? rig.measurement.upper_edge_age_ns : rig.measurement.lower_edge_age_ns;
      unknown += age_ns == rig::no_edge_age ? 1 : 0;
      if (age_ns != rig::no_edge_age) REQUIRE(std::abs(rig.now_ns - rig.board.last_edge_ns(upper) - age_ns) <= 1000);
    }
    oldest_ns = std::min(rig.measurement.upper_edge_age_ns, rig.measurement.lower_edge_age_ns);
  }
  CHECK(cycles > 500);
  CHECK(unknown <= 2);  // before a wheel's first edge
  CHECK(oldest_ns >= 200 * ms);
}

TEST_CASE("A board that stamps no edges gives no ages") {
  Rig rig({}, 60.0);
  rig.board.stamps_edges = false;
  for (int i = 0; i < 100; ++i) {
    REQUIRE(rig.cycle(rig::safe_command).ok());
    REQUIRE(rig.measurement.upper_edge_age_ns == rig::no_edge_age);
    REQUIRE(rig.measurement.lower_edge_age_ns == rig::no_edge_age);
  }
}

TEST_CASE("An edge that may lie a wrap of its stamp back has no age") {
  Rig rig({}, 60.0);
  REQUIRE(rig.driver.rest().ok());
  for (const std::int64_t pause_ns : {20 * ms, 40 * ms, 20 * ms}) {
    rig.board.advance_to(rig.now_ns += pause_ns);
    REQUIRE(rig.driver.read(rig.now_ns, rig.measurement).ok());
    if (pause_ns == 40 * ms) CHECK(rig.measurement.lower_edge_age_ns == rig::no_edge_age);
  }
  CHECK(rig.measurement.lower_edge_age_ns >= 0);
  CHECK(rig.measurement.lower_edge_age_ns < 100'000);  // 39 counts a ms
}

TEST_CASE("The relay's pin changes with each command, the enabling pin follows the motor, both active-low") {
  Rig rig({.enable_pin = 0, .relay_pin = 7});
  REQUIRE(rig.cycle(drive).ok());
  const std::uint32_t first = rig.board.written[0x1000];
  REQUIRE(rig.cycle(drive).ok());
  const std::uint32_t second = rig.board.written[0x1000];
  CHECK((first & 1U) == 1U);
  CHECK((first ^ second) == 1U << 7U);
  REQUIRE(rig.cycle(rig::safe_command).ok());
  CHECK((rig.board.written[0x1000] & 1U) == 0U);
  CHECK((rig.board.written[0x1400] & 0x83U) == 0x83U);
  CHECK((rig.board.written[0x1100] & 0x83U) == 0x83U);
}

TEST_CASE("The identity for the commissioning record is name, versions and MAC") {
  Rig rig;
  CHECK(rig.driver.identity().place == "00:00:1b:60:3b:10");
  CHECK(rig.driver.identity().logic == "7I92, IDROM MESA7I92, LBP16 3, firmware 16");
}

TEST_CASE("The last 64 datagrams are kept with their times") {
  Rig rig;
  REQUIRE(rig.cycles(100, drive).ok());
  const auto lines = rig.driver.traffic();
  REQUIRE(lines.size() == 64);
  CHECK_THAT(lines.back(), Contains(" sent  40 82c20010"));
  CHECK_THAT(lines[lines.size() - 2], Contains(" got   54 "));
}
