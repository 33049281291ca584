// Reads a board's description of itself, refuses what cannot be true, and finds the pins that the rig uses.

#include <algorithm>
#include <array>
#include <initializer_list>
#include <map>
#include <tuple>

#include "driver/board_kit.hpp"
#include "driver/hm2/wire.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

using rig::formatted;

namespace {

constexpr std::uint32_t cookie_value = 0x55AACAFE;
constexpr unsigned most_modules = 32;
constexpr unsigned most_instances = 64;
constexpr std::uint32_t first_base = 0x0800;  // the identity and the descriptors are below
constexpr std::uint32_t end_of_space = 0x10000;

/// A module that this driver uses, with what it must be.
struct Known {
  std::uint8_t tag;
  const char* name;
  std::initializer_list<unsigned> versions;
  unsigned registers;
  std::uint32_t multiple;  ///< bit k: register k exists for each instance
  unsigned least;          ///< instances that the rig needs
  Module Board::*place;
};
const std::array<Known, 4>& known_modules() {
  static const std::array<Known, 4> known{{
      {tag::watchdog, "watchdog", {0}, 3, 0x00, 1, &Board::watchdog},
      {tag::port, "I/O port", {0}, 5, 0x1F, 1, &Board::port},
      {tag::counter, "quadrature counter", {2, 3, 0x83}, 5, 0x03, 2, &Board::counter},
      {tag::pwm, "PWM", {0, 1}, 5, 0x03, 2, &Board::pwm},
  }};
  return known;
}

/// Takes the place of the plain counters. The time stamps of version 2 are wrong (LinuxCNC's encoder.c).
const Known& multiplexed_counter() {
  static const Known known{tag::muxed_counter, "multiplexed (MuxedQCount) counter", {3, 4, 0x84}, 5, 0x03, 4,
                           &Board::counter};
  return known;
}

/// Reads a board's description. `place` is how messages name it.
class Reader {
 public:
  Reader(Link& link, const std::string& place, std::uint32_t& number) : link_(link), place_(place), number_(number) {}
  Board read() {
    const auto id = words(at::cookie, 4);
    if (id[0] != cookie_value) refuse(formatted("its cookie is 0x%08x, not 0x%08x", id[0], cookie_value));
    if (id[1] != 0x54534F48 || id[2] != 0x32544F4D) refuse("it does not call itself HOSTMOT2");
    read_info();
    read_idrom(static_cast<std::uint16_t>(id[3] & 0xFFFFU));
    return board_;
  }

 private:
  [[noreturn]] void refuse(const std::string& fact) const {
    driver::refuse("the board at " + place_ + ": " + fact +
                   "; this driver does not know it, and no output was written (docs/hm2.md)");
  }
  std::vector<std::uint8_t> bytes(unsigned from_space, std::uint16_t address, unsigned units) {
    Packet packet;
    packet.read(from_space, address, units);
    std::vector<std::uint8_t> answer(packet.answer_bytes());
    if (!ask(link_, packet, answer, number_)) {
      driver::refuse("the board at " + place_ +
                     " does not answer: check its power, the cable and the address of this computer's interface "
                     "(docs/hm2.md, \"The network\")");
    }
    return answer;
  }
  std::vector<std::uint32_t> words(std::uint32_t address, unsigned units) {
    if (address + 4 * units > end_of_space) refuse(formatted("a descriptor at 0x%x is outside its space", address));
    const auto raw = bytes(space::hostmot2, static_cast<std::uint16_t>(address), units);
    std::vector<std::uint32_t> values(units);
    for (unsigned i = 0; i < units; ++i) values[i] = word32(raw, std::size_t{4} * i);
    return values;
  }
  static std::string text(std::span<const std::uint8_t> bytes) {
    std::string text;
    for (const std::uint8_t byte : bytes) {
      if (byte == 0) break;
      text += byte >= ' ' && byte <= '~' ? static_cast<char>(byte) : '?';
    }
    return text;
  }

  void read_info() {
    constexpr std::size_t name_bytes = 16;
    const auto info = bytes(space::board_info, at::board_name, 10);
    board_.name = text(std::span(info).first<name_bytes>());
    board_.protocol_version = word16(info, name_bytes);
    board_.firmware_version = word16(info, name_bytes + 2);
    constexpr unsigned known_version = 3;
    // 0: it does not tell. That it answers shows the format; nothing but the reads below depends on the version.
    if (board_.protocol_version != known_version && board_.protocol_version != 0) {
      refuse(formatted("it speaks version %u of LBP16, not %u", board_.protocol_version, known_version));
    }
    const auto mac = bytes(space::eeprom, at::mac, 3);
    board_.mac = formatted("%02x:%02x:%02x:%02x:%02x:%02x", mac[5], mac[4], mac[3], mac[2], mac[1], mac[0]);
  }

  void read_idrom(std::uint16_t place) {
    const auto idrom = words(place, 16);
    if (idrom[0] != 2 && idrom[0] != 3) refuse(formatted("its IDROM has type %u, not 2 or 3", idrom[0]));
    std::array<std::uint8_t, 8> name{};
    for (std::size_t i = 0; i < name.size(); ++i) name[i] = (idrom[3 + i / 4] >> (8 * (i % 4))) & 0xFFU;
    board_.idrom_name = text(name);
    board_.ports = idrom[7];
    board_.port_width = idrom[9];
    if (board_.ports < 1 || board_.ports > most_ports || board_.port_width < 1 || board_.port_width > 32 ||
        idrom[8] != board_.ports * board_.port_width) {
      refuse(formatted("its IDROM claims %u I/O pins in %u ports of %u pins: at most %u ports of 32 pins that add up",
                       idrom[8], idrom[7], idrom[9], most_ports));
    }
    board_.clock_low_Hz = clock("ClockLow", idrom[10]);
    board_.clock_high_Hz = clock("ClockHigh", idrom[11]);
    if (idrom[1] >= end_of_space || idrom[2] >= end_of_space) refuse("its descriptors are outside its space");
    read_modules(place + idrom[1], {idrom[12], idrom[13]}, {idrom[14], idrom[15]});
    read_pins(place + idrom[2]);
  }

  double clock(const char* name, std::uint32_t Hz) const {
    constexpr std::uint32_t least_Hz = 1'000'000;
    constexpr std::uint32_t most_Hz = 1'000'000'000;
    if (Hz < least_Hz || Hz > most_Hz) refuse(formatted("its %s is %u Hz, not 1 MHz to 1 GHz", name, Hz));
    return Hz;
  }

  using Strides = std::array<std::uint32_t, 2>;
  void read_modules(std::uint32_t place, const Strides& instance_strides, const Strides& register_strides) {
    std::vector<std::uint32_t> multiplexed;
    for (unsigned i = 0; i < most_modules; ++i) {
      const auto word = words(place + 12 * i, 3);
      const auto its_tag = static_cast<std::uint8_t>(word[0]);
      if (its_tag == 0) break;
      const unsigned instances = word[0] >> 24U;
      board_.modules.push_back(formatted("module %u: tag %u, version %u, %u instances, base 0x%04x", i, its_tag,
                                         (word[0] >> 8U) & 0xFFU, instances, word[1] & 0xFFFFU));
      for (const Known& known : known_modules()) {
        if (known.tag == its_tag) take_module(known, word, instance_strides, register_strides);
      }
      if (its_tag == tag::muxed_counter) multiplexed = word;
    }
    if (board_.counter.instances < 2 && !multiplexed.empty()) {
      board_.counter = {};
      board_.multiplexed = true;
      take_module(multiplexed_counter(), multiplexed, instance_strides, register_strides);
      require_enough(multiplexed_counter());
    }
    for (const Known& known : known_modules()) require_enough(known);
    require_registers_apart();
    if (board_.port.instances != board_.ports) {
      refuse(formatted("it has %u I/O port instances and %u ports", board_.port.instances, board_.ports));
    }
  }

  void require_enough(const Known& known) const {
    const unsigned has = (board_.*known.place).instances;
    if (has >= known.least) return;
    refuse(formatted("it has %u %s%s, the rig needs %u", has, known.name, has == 1 ? "" : "s", known.least));
  }

  void take_module(const Known& known, const std::vector<std::uint32_t>& word, const Strides& instance_strides,
                   const Strides& register_strides) {
    const auto require = [&](bool possible, const std::string& fact) {
      if (!possible) refuse(formatted("its %s module ", known.name) + fact);
    };
    Module& module = board_.*known.place;
    if (module.instances != 0) refuse(formatted("it describes its %s module twice", known.name));
    const unsigned instances = word[0] >> 24U;
    const unsigned registers = (word[1] >> 16U) & 0xFFU;
    const unsigned strides = word[1] >> 24U;  // register stride in the low four bits, instance stride above
    const unsigned version = (word[0] >> 8U) & 0xFFU;
    require(std::ranges::find(known.versions, version) != known.versions.end(),
            formatted("has the unknown version %u", version));
    require(registers == known.registers && word[2] == known.multiple,
            formatted("has %u registers, bitmap 0x%x, not %u and 0x%x", registers, word[2], known.registers,
                      known.multiple));
    require(instances >= 1 && instances <= most_instances,
            formatted("claims %u instances: 1 to %u are possible", instances, most_instances));
    const unsigned clock = (word[0] >> 16U) & 0xFFU;
    require((clock == 1 || clock == 2) && (strides & 0xFU) <= 1 && strides >> 4U <= 1,
            formatted("names clock %u and strides 0x%02x, which do not exist", clock, strides));
    const std::uint32_t base = word[1] & 0xFFFFU;
    const std::uint32_t register_stride = register_strides[strides & 0xFU];
    const std::uint32_t instance_stride = instance_strides[strides >> 4U];
    const std::uint64_t last =
        base + std::uint64_t{registers - 1} * register_stride + std::uint64_t{instances - 1} * instance_stride;
    const bool apart = register_stride >= std::uint64_t{instances} * instance_stride || known.multiple == 0;
    require(base >= first_base && last + 4 <= end_of_space && base % 4 == 0 && register_stride % 4 == 0 &&
                instance_stride % 4 == 0 && register_stride != 0 && instance_stride != 0 && apart,
            formatted("has base 0x%x, register stride %u, instance stride %u: outside its space 0x%x to 0x%x, or upon "
                      "each other",
                      base, register_stride, instance_stride, first_base, end_of_space - 1));
    module = {.instances = instances,
              .base = static_cast<std::uint16_t>(base),
              .register_stride = static_cast<std::uint16_t>(register_stride),
              .instance_stride = static_cast<std::uint16_t>(instance_stride),
              .clock_Hz = clock == 1 ? board_.clock_low_Hz : board_.clock_high_Hz};
  }

  void require_registers_apart() const {
    std::map<std::uint16_t, const char*> owners;
    for (const Known& known : known_modules()) {
      const Module& module = board_.*known.place;
      for (unsigned reg = 0; reg < known.registers; ++reg) {
        const unsigned instances = (known.multiple >> reg & 1U) != 0 ? module.instances : 1;
        for (unsigned instance = 0; instance < instances; ++instance) {
          const std::uint16_t address = module.address(reg, instance);
          const auto [owner, is_new] = owners.emplace(address, known.name);
          if (!is_new) {
            refuse(
                formatted("its %s and its %s module both have the register 0x%x", owner->second, known.name, address));
          }
        }
      }
    }
  }

  void read_pins(std::uint32_t place) {
    constexpr unsigned at_once = 64;
    const unsigned pins = board_.ports * board_.port_width;
    for (unsigned first = 0; first < pins; first += at_once) {
      for (const std::uint32_t word : words(place + 4 * first, std::min(at_once, pins - first))) {
        const unsigned pin = static_cast<unsigned>(board_.pins.size());
        if (word >> 24U != tag::port) refuse(formatted("its pin %u has the primary function %u", pin, word >> 24U));
        board_.pins.push_back({.function = static_cast<std::uint8_t>(word),
                               .tag = static_cast<std::uint8_t>(word >> 8U),
                               .unit = static_cast<std::uint8_t>(word >> 16U)});
      }
    }
  }

  Link& link_;
  const std::string& place_;
  std::uint32_t& number_;
  Board board_{};
};

}  // namespace

Board read_board(Link& link, const std::string& place, std::uint32_t& number) {
  return Reader(link, place, number).read();
}

UsedPins find_pins(const Board& board, const Hm2Options& options) {
  using std::tuple;
  // Multiplexed, two counters share pins.
  const std::uint8_t counter = board.multiplexed ? tag::muxed_counter : tag::counter;
  const auto unit_of = [&](std::int32_t channel) { return board.multiplexed ? channel / 2 : channel; };
  const auto pin_of = [&](std::uint8_t of, std::uint8_t function, std::int32_t unit) {
    const auto pin = std::ranges::find_if(
        board.pins, [&](const Pin& p) { return p.tag == of && p.function == function && p.unit == unit; });
    return pin == board.pins.end() ? -1 : static_cast<std::int32_t>(pin - board.pins.begin());
  };
  for (const auto& [key, instance, module] : {tuple("drive_pwm", options.drive_pwm, &board.pwm),
                                              {"brake_pwm", options.brake_pwm, &board.pwm},
                                              {"lower_channel", options.lower_channel, &board.counter},
                                              {"upper_channel", options.upper_channel, &board.counter}}) {
    const std::string given = formatted("driver.hm2.%s = %d: ", key, instance);
    if (static_cast<unsigned>(instance) >= module->instances) {
      refuse(given + formatted("the board has the instances 0 to %u", module->instances - 1));
    }
    if (module == &board.pwm) {
      if (pin_of(tag::pwm, pwm_output, instance) >= 0) continue;
      std::string others;
      for (std::int32_t n = 0; n < static_cast<std::int32_t>(module->instances); ++n) {
        if (const auto pin = pin_of(tag::pwm, pwm_output, n); pin >= 0)
          others += formatted("%s %d (I/O %d)", others.empty() ? "" : ",", n, pin);
      }
      refuse(given + "this firmware brings that PWM to no I/O pin, " +
             (others.empty() ? "nor any other" : "but" + others));
    }
    if (board.multiplexed && instance % 2 == 0) {
      refuse(given + formatted("this board's counters are multiplexed (MuxedQCount), and those of even numbers stop "
                               "with the outputs: connect the wheels to odd ones, 1 to %u, and give their numbers",
                               module->instances - 1));
    }
    for (const std::uint8_t line : {signal_a, signal_b}) {
      if (pin_of(counter, line, unit_of(instance)) >= 0) continue;
      refuse(given + "this firmware brings the signals A and B of that counter to no I/O pins");
    }
  }
  const auto selects = [&](const Pin& pin) { return board.multiplexed && pin.tag == tag::muxed_select; };
  if (board.multiplexed && std::ranges::none_of(board.pins, selects)) {
    refuse("the hm2 board's counters are multiplexed, and no I/O pin selects one of them");
  }
  UsedPins used;
  PortWords counted{};
  const auto word = [&](PortWords& words, std::size_t pin) -> std::uint32_t& { return words[pin / board.port_width]; };
  const auto bit = [&](std::size_t pin) { return 1U << (pin % board.port_width); };
  const auto claim = [&](const char* key, std::int32_t number) {
    const auto pin = static_cast<std::size_t>(number);
    if (pin >= board.pins.size()) {
      refuse(formatted("driver.hm2.%s = %d: the board has the I/O pins 0 to %zu", key, number, board.pins.size() - 1));
    }
    if ((word(used.outputs, pin) & bit(pin)) != 0) refuse(formatted("I/O pin %d has two uses", number));
    if ((word(counted, pin) & bit(pin)) != 0) {
      refuse(formatted("driver.hm2.%s = %d: this I/O pin is an input of an encoder's counter; give a free one", key,
                       number));
    }
    word(used.outputs, pin) |= bit(pin);
    if (options.active_low) word(used.inverted, pin) |= bit(pin);
  };
  for (std::size_t i = 0; i < board.pins.size(); ++i) {
    const Pin& pin = board.pins[i];
    const bool counts = pin.tag == counter &&
                        (pin.unit == unit_of(options.lower_channel) || pin.unit == unit_of(options.upper_channel));
    if (counts || selects(pin)) word(used.modules, i) |= bit(i);
    if (counts) word(counted, i) |= bit(i);
    if (selects(pin)) word(used.outputs, i) |= bit(i);
  }
  for (const auto& [key, pwm, wanted] : {tuple("drive_pin", options.drive_pwm, options.drive_pin),
                                         {"brake_pin", options.brake_pwm, options.brake_pin}}) {
    const std::int32_t has = pin_of(tag::pwm, pwm_output, pwm);
    if (wanted >= 0 && wanted != has) {
      refuse(
          formatted("driver.hm2.%s = %d, but the board has that PWM at I/O pin %d: its firmware is another one; "
                    "correct the key, or load G540x2",
                    key, wanted, has));
    }
    word(used.modules, static_cast<std::size_t>(has)) |= bit(static_cast<std::size_t>(has));
    claim(key, has);
  }
  for (const auto& [key, pin, words] :
       {tuple("enable_pin", options.enable_pin, &used.enable), {"relay_pin", options.relay_pin, &used.relay}}) {
    if (pin < 0) continue;
    claim(key, pin);
    word(*words, static_cast<std::size_t>(pin)) |= bit(static_cast<std::size_t>(pin));
  }
  return used;
}

}  // namespace abs_hil::driver::hm2
