// Firmware of each family as its public pin file describes it (LinuxCNC/hostmot2-firmware): modules and pins alone, as
// the descriptors of a board would have them. Which of them the driver takes, and what it says of the others.

#include <map>

#include "active_rig.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::test;
using Catch::Matchers::Contains;

namespace {

// Module descriptors: tag, version, clock (1 low, 2 high), instances.
constexpr unsigned watchdog = 2, port = 3, counter = 4, stepgen = 5, pwm = 6, ssi = 8, muxed = 12, muxed_select = 13,
                   biss = 22, dpll = 26, leds = 128, resolver = 192, smart_serial = 193;
struct ModuleRow {
  unsigned tag;
  unsigned version;
  unsigned instances;
};
struct PinRow {
  unsigned io;
  unsigned unit;
  unsigned tag;
  unsigned function;
};
struct Family {
  const char* name;
  unsigned ports;
  unsigned port_width;
  std::vector<ModuleRow> modules;
  std::vector<PinRow> pins;
};

/// A, B and index of a counter from `io` on.
void add_counter(std::vector<PinRow>& pins, unsigned io, unsigned unit, unsigned tag = counter) {
  for (unsigned line = 0; line < 3; ++line) pins.push_back({io + line, unit, tag, line + 1});
}

void describe(RegisterBoard& board, const Family& family) {
  const std::map<unsigned, std::pair<std::uint32_t, std::uint32_t>> known{
      {watchdog, {0x00030C00, 0}}, {port, {0x00051000, 0x1F}}, {counter, {0x00053000, 3}},
      {muxed, {0x00053500, 3}},    {pwm, {0x00054000, 3}},     {stepgen, {0x000A2000, 0x1FF}}};
  std::erase_if(board.rom, [](const auto& word) { return word.first >= 0x440; });
  board.rom[0x41C] = family.ports;
  board.rom[0x420] = family.ports * family.port_width;
  board.rom[0x424] = family.port_width;
  std::uint16_t at = 0x440;
  for (const ModuleRow& module : family.modules) {
    const auto place = known.find(module.tag);
    const unsigned clock = module.tag == pwm ? 2 : 1;
    board.rom[at] = module.tag | module.version << 8U | clock << 16U | module.instances << 24U;
    board.rom[static_cast<std::uint16_t>(at + 4)] = place == known.end() ? 0 : place->second.first;
    board.rom[static_cast<std::uint16_t>(at + 8)] = place == known.end() ? 0 : place->second.second;
    at = static_cast<std::uint16_t>(at + 12);
  }
  board.rom[at] = 0;
  for (unsigned io = 0; io < family.ports * family.port_width; ++io) {
    board.rom[static_cast<std::uint16_t>(0x600 + 4 * io)] = 0x03000000;
  }
  for (const PinRow& pin : family.pins) {
    board.rom[static_cast<std::uint16_t>(0x600 + 4 * pin.io)] =
        0x03000000 | pin.unit << 16U | pin.tag << 8U | pin.function;
  }
}

/// "taken", or why not.
std::string verdict(const Family& family, const Hm2Options& options) {
  RegisterBoard board;
  describe(board, family);
  Cable cable(board);
  const auto link = cable.opener()();
  std::uint32_t number = 0;
  try {
    static_cast<void>(hm2::find_pins(hm2::read_board(*link, "here", number), options));
  } catch (const Unavailable& error) {
    CHECK(board.writes == 0);
    return error.what();
  }
  return "taken";
}

/// PIN_7I97_7I78D_51: encoders and analog outputs on the board itself.
Family on_7i97(unsigned version = 4, unsigned counters = 8, unsigned pwms = 7) {
  Family family{"7I97_7I78D",
                3,
                17,
                {{dpll, 0, 1},
                 {watchdog, 0, 1},
                 {port, 0, 3},
                 {muxed, version, counters},
                 {muxed_select, 0, 1},
                 {smart_serial, 0, 1},
                 {stepgen, 2, 4},
                 {pwm, 0, pwms},
                 {leds, 0, 1}},
                {{18, 4, muxed_select, 0x81}}};  // its unit says nothing
  for (unsigned unit = 0; unit < 5; ++unit) family.pins.push_back({unit, unit, pwm, 0x81});
  for (unsigned pair = 0; pair < 3; ++pair) add_counter(family.pins, 9 + 3 * pair, pair, muxed);
  return family;
}

/// PIN_SVST16_24_144: each pair of servo axes has twelve pins. PIN_SVST8_3P_72 has the same, with version 3.
Family on_svst16(unsigned version = 2) {
  Family family{
      "SVST16_24", 6, 24, {{watchdog, 0, 1}, {port, 0, 6}, {counter, version, 16}, {pwm, 0, 16}, {stepgen, 2, 24}}, {}};
  for (unsigned pair = 0; pair < 8; ++pair) {
    const unsigned io = 12 * pair;
    for (const unsigned odd : {0U, 1U}) {  // the odd axis comes first
      const unsigned unit = 2 * pair + 1 - odd;
      family.pins.push_back({io + 2 * odd, unit, counter, 2});
      family.pins.push_back({io + 2 * odd + 1, unit, counter, 1});
      family.pins.push_back({io + 6 + odd, unit, pwm, 0x81});
    }
  }
  return family;
}

Family without_pins(const char* name, std::vector<ModuleRow> modules) {
  modules.insert(modules.begin(), {{watchdog, 0, 1}, {port, 0, 2}});
  return {name, 2, 17, std::move(modules), {}};
}

const Hm2Options any_pins{.drive_pin = -1, .brake_pin = -1};
const Hm2Options odd_counters{.drive_pin = -1, .brake_pin = -1, .lower_channel = 1, .upper_channel = 3};

}  // namespace

TEST_CASE("Servo firmware with plain counters is taken, with the PWM's pins as that firmware has them") {
  CHECK(verdict(on_svst16(), any_pins) == "taken");
  CHECK(verdict(on_svst16(3), any_pins) == "taken");
  CHECK(verdict(on_svst16(), {.drive_pin = 7, .brake_pin = 6}) == "taken");
  CHECK_THAT(verdict(on_svst16(), {}), Contains("driver.hm2.drive_pin = 1, but the board has that PWM at I/O pin 7"));
  // The last axes: register 15 of each module.
  CHECK(verdict(on_svst16(), {.drive_pwm = 15,
                              .brake_pwm = 14,
                              .drive_pin = 90,
                              .brake_pin = 91,
                              .lower_channel = 15,
                              .upper_channel = 14}) == "taken");
}

TEST_CASE("Multiplexed counters are taken at odd numbers, which count without the select pin") {
  CHECK(verdict(on_7i97(), odd_counters) == "taken");
  CHECK(verdict(on_7i97(3), odd_counters) == "taken");
  CHECK(verdict(on_7i97(0x84), odd_counters) == "taken");
  CHECK_THAT(verdict(on_7i97(), any_pins),
             Contains("driver.hm2.lower_channel = 0: this board's counters are multiplexed (MuxedQCount)") &&
                 Contains("odd ones, 1 to 7"));
  CHECK_THAT(verdict(on_7i97(2), odd_counters),
             Contains("multiplexed (MuxedQCount) counter module has the unknown version 2"));
  CHECK_THAT(verdict(on_7i97(4, 2), odd_counters),
             Contains("it has 2 multiplexed (MuxedQCount) counters, the rig needs 4"));
  Family no_select = on_7i97();
  no_select.pins.front().tag = 0;
  CHECK_THAT(verdict(no_select, odd_counters), Contains("no I/O pin selects one of them"));
  Family no_b = on_7i97();
  std::erase_if(no_b.pins, [](const PinRow& pin) { return pin.tag == muxed && pin.unit == 1 && pin.function == 2; });
  CHECK_THAT(
      verdict(no_b, odd_counters),
      Contains("driver.hm2.upper_channel = 3: this firmware brings the signals A and B of that counter to no I/O"));
  Hm2Options relay = odd_counters;
  relay.relay_pin = 18;
  CHECK_THAT(verdict(on_7i97(), relay), Contains("I/O pin 18 has two uses"));
  // Plain counters beside them are enough, whatever version the others have.
  Family both = on_7i97(2);
  both.modules.push_back({counter, 2, 2});
  add_counter(both.pins, 40, 0);
  add_counter(both.pins, 43, 1);
  CHECK(verdict(both, any_pins) == "taken");
}

TEST_CASE("Up to 64 PWMs are taken, and one that has no pin is named with those that have one") {
  CHECK(verdict(on_7i97(4, 8, 64), odd_counters) == "taken");
  CHECK_THAT(verdict(on_7i97(4, 8, 65), odd_counters), Contains("PWM module claims 65 instances: 1 to 64"));
  Hm2Options sixth = odd_counters;
  sixth.brake_pwm = 6;
  CHECK_THAT(
      verdict(on_7i97(), sixth),
      Contains("driver.hm2.brake_pwm = 6: this firmware brings that PWM to no I/O pin, but 0 (I/O 0), 1 (I/O 1), "
               "2 (I/O 2), 3 (I/O 3), 4 (I/O 4)"));
  Family none = on_7i97();
  std::erase_if(none.pins, [](const PinRow& pin) { return pin.tag == pwm; });
  CHECK_THAT(verdict(none, odd_counters), Contains("brings that PWM to no I/O pin, nor any other"));
}

TEST_CASE("A counter without its signals' pins counts nothing, and is refused") {
  Family blind = on_svst16();
  std::erase_if(blind.pins, [](const PinRow& pin) { return pin.tag == counter && pin.unit == 1 && pin.function == 1; });
  CHECK_THAT(verdict(blind, any_pins),
             Contains("driver.hm2.upper_channel = 1: this firmware brings the signals A and B"));
}

TEST_CASE("Firmware without two counters or two PWMs is refused with what it lacks") {
  struct Row {
    Family family;
    const char* lacks;
  };
  for (const Row& row : {
           Row{without_pins("G540_7I85S", {{muxed, 4, 4}, {muxed_select, 0, 1}, {stepgen, 2, 9}, {pwm, 0, 1}}),
               "it has 1 PWM, the rig needs 2"},
           Row{without_pins("7I77x2_ssi", {{muxed, 4, 12}, {muxed_select, 0, 1}, {smart_serial, 0, 1}, {ssi, 0, 2}}),
               "it has 0 PWMs, the rig needs 2"},
           Row{without_pins("7I76x2", {{counter, 2, 2}, {smart_serial, 0, 1}, {stepgen, 2, 10}}), "it has 0 PWMs"},
           Row{without_pins("7I85Sx2", {{muxed, 4, 8}, {muxed_select, 0, 1}, {smart_serial, 0, 1}, {stepgen, 2, 8}}),
               "it has 0 PWMs"},
           Row{without_pins("SVBI8_8", {{counter, 2, 8}, {biss, 0, 8}}), "it has 0 PWMs"},
           Row{without_pins("G540 on one port", {{counter, 2, 1}, {pwm, 0, 1}, {stepgen, 2, 5}}),
               "it has 1 quadrature counter, the rig needs 2"},
           Row{without_pins("ST12", {{stepgen, 2, 12}}), "it has 0 quadrature counters, the rig needs 2"},
           Row{without_pins("RMSVSS6_8", {{resolver, 0, 1}, {pwm, 0, 6}, {smart_serial, 0, 1}}),
               "it has 0 quadrature counters"},
           Row{without_pins("IOONLY", {}), "it has 0 quadrature counters"},
       }) {
    CAPTURE(row.family.name);
    CHECK_THAT(verdict(row.family, odd_counters), Contains(row.lacks));
  }
}

namespace {

/// A rig whose board has multiplexed counters in place of the plain ones: wheels at 1 and 3, select pin 10.
struct MuxedRig {
  explicit MuxedRig(double speed_rad_s) : board(speed_rad_s), driver(options(), cable.opener()) {
    board.rom[0x458] = 0x0401030C;
    board.rom[0x45C] = 0x00053500;
    for (const unsigned io : {13U, 14U, 15U, 30U, 31U, 32U}) {
      std::uint32_t& pin = board.rom[static_cast<std::uint16_t>(0x600 + 4 * io)];
      pin = (pin & ~0xFF00U) | 0x0C00U;
    }
    board.rom[0x628] = 0x03000D81;
    board.counters = 0x3500;
    board.counters_of_wheels = {1, 3};
    driver.configure();
    driver.activate(0);
  }
  static Hm2Options options() { return {.lower_channel = 1, .upper_channel = 3}; }

  RegisterBoard board;
  Cable cable{board};
  Hm2Driver driver;
};

}  // namespace

TEST_CASE("A run on multiplexed counters reads what one on plain counters reads, and drives the select pin") {
  constexpr double speed_rad_s = 120.0;
  MuxedRig muxed_rig(speed_rad_s);
  Rig plain({}, speed_rad_s);
  constexpr std::uint32_t select = 1U << 10U;
  CHECK((muxed_rig.board.ddr()[0] & select) != 0);
  CHECK((muxed_rig.board.written[0x1200] & select) != 0);  // the pin carries its module
  CHECK((muxed_rig.board.written[0x1400] & select) == 0);  // and is not inverted
  CHECK(muxed_rig.board.written[0x3900] == 10);            // 100 MHz / (10 + 2): the multiplexer's 8 MHz
  CHECK(muxed_rig.board.written[0x3604] == 0x0800);
  CHECK(muxed_rig.board.written[0x360C] == 0x0800);
  CHECK(muxed_rig.board.written.count(0x3000) + muxed_rig.board.written.count(0x3100) == 0);
  const rig::Command command{.brake_duty = 0.25};
  for (int cycle = 0; cycle < 300; ++cycle) {
    REQUIRE(plain.cycle(command).ok());
    rig::Measurement measurement;
    rig::Command sent;
    muxed_rig.board.advance_to(plain.now_ns);
    REQUIRE(muxed_rig.driver.read(plain.now_ns, measurement).ok());
    REQUIRE(muxed_rig.driver.write(command, sent).ok());
    REQUIRE(measurement.upper_counts == plain.measurement.upper_counts);
    REQUIRE(measurement.lower_counts == plain.measurement.lower_counts);
    REQUIRE(measurement.upper_edge_age_ns == plain.measurement.upper_edge_age_ns);
  }
  CHECK(plain.measurement.upper_counts > 1000);
  REQUIRE(muxed_rig.driver.rest().ok());
  CHECK(muxed_rig.board.ddr()[0] == 0);
  rig::Measurement at_rest;
  muxed_rig.board.advance_to(plain.now_ns + 5 * ms);
  REQUIRE(muxed_rig.driver.read(plain.now_ns + 5 * ms, at_rest).ok());
  CHECK(at_rest.lower_counts > plain.measurement.lower_counts);  // the wheels are seen with the outputs off
  muxed_rig.board.control[1] = hm2::quadrature_error;
  CHECK(muxed_rig.driver.read(plain.now_ns + 6 * ms, at_rest).reason == rig::Reason::hm2_quadrature_error);
}
