// What a 7I92 with firmware G540x2 says about itself, and the ways in which a wrong board differs from it.

#include <algorithm>

#include "emulator/fault_text.hpp"
#include "emulator/udp_board.hpp"

namespace abs_hil::emulator {

namespace {

constexpr std::uint32_t idrom = 0x400;
constexpr std::uint32_t modules = 0x440;
constexpr std::uint32_t pins = 0x600;
constexpr std::uint32_t pin_count = 34;
constexpr std::uint32_t module_words = 3;

constexpr std::uint32_t text_word(const char (&four)[5]) {
  std::uint32_t word = 0;
  for (std::size_t i = 4; i > 0; --i) word = word * 256U + static_cast<std::uint8_t>(four[i - 1]);
  return word;
}

/// Module descriptors in the order of the recording with LinuxCNC: watchdog, I/O ports, counters, PWM, LEDs.
constexpr std::array<std::uint32_t, 15> module_table{
    0x01010002, 0x00030C00, 0x00,   // watchdog: 1 instance on ClockLow, 3 registers at 0C00
    0x02010003, 0x00051000, 0x1F,   // I/O ports: 2 instances, 5 registers at 1000, all of them per port
    0x02010204, 0x00053000, 0x03,   // counters: version 2, 2 instances, count and control per counter
    0x02020006, 0x00054000, 0x03,   // PWM on ClockHigh: 2 instances, value and mode per generator
    0x01010080, 0x00010200, 0x00};  // LEDs
constexpr std::uint32_t place_of_counters = 2;
constexpr std::uint32_t place_of_pwm = 3;

constexpr std::uint32_t pin(std::uint32_t number, std::uint32_t tag, std::uint32_t unit) {
  return 0x03000000U | unit << 16U | tag << 8U | number;
}

std::vector<std::uint32_t> stock_words() {
  std::vector<std::uint32_t> words(pins / 4 + 512 / 4, 0);
  words[0x100 / 4] = 0x55AACAFE;
  words[0x104 / 4] = text_word("HOST");
  words[0x108 / 4] = text_word("MOT2");
  words[0x10C / 4] = idrom;
  const std::array<std::uint32_t, 16> header{
      3,   modules - idrom, pins - idrom, text_word("MESA"), text_word("7I92"),
      9,    // size of the FPGA
      144,  // its pins
      2,   pin_count,       17,           100'000'000,       200'000'000,       4, 64, 256, 4};
  std::copy(header.begin(), header.end(), words.begin() + idrom / 4);
  std::copy(module_table.begin(), module_table.end(), words.begin() + modules / 4);
  for (std::uint32_t io = 0; io < pin_count; ++io) words[pins / 4 + io] = pin(0, 0, 0);
  for (std::uint32_t unit = 0; unit < 2; ++unit) {
    const std::uint32_t first = pins / 4 + unit * 17;
    words[first + 1] = pin(0x81, 6, unit);
    for (std::uint32_t line = 0; line < 3; ++line) words[first + 13 + line] = pin(line + 1, 4, unit);
  }
  return words;
}

std::uint32_t& at(Hm2Identity& board, std::uint32_t address) { return board.words[address / 4]; }
/// The first word of a module's descriptor, or the one `word` words after it.
std::uint32_t& module(Hm2Identity& board, std::uint32_t place, std::uint32_t word = 0) {
  return board.words[modules / 4 + module_words * place + word];
}
void set_instances(Hm2Identity& board, std::uint32_t place, std::uint32_t instances) {
  module(board, place) = (module(board, place) & 0x00FFFFFFU) | instances << 24U;
}

/// A lie about one thing, and what it changes.
struct Lie {
  std::string_view name;
  void (*tell)(Hm2Identity&);
};
constexpr std::array<Lie, 22> lies_told{{
    {"cookie", [](Hm2Identity& b) { at(b, 0x100) = 0x55AACAFF; }},
    {"not-hostmot2", [](Hm2Identity& b) { at(b, 0x108) = text_word("MOT3"); }},
    {"idrom-outside", [](Hm2Identity& b) { at(b, 0x10C) = 0xFFF0; }},
    {"idrom-type", [](Hm2Identity& b) { at(b, idrom) = 9; }},
    {"modules-outside", [](Hm2Identity& b) { at(b, idrom + 4) = 0xFFFF; }},
    {"width", [](Hm2Identity& b) { at(b, idrom + 32) = 72; }},
    {"port-width", [](Hm2Identity& b) { at(b, idrom + 36) = 40; }},
    {"clock-zero", [](Hm2Identity& b) { at(b, idrom + 40) = at(b, idrom + 44) = 0; }},
    {"strides", [](Hm2Identity& b) { at(b, idrom + 48) = at(b, idrom + 56) = 0; }},
    {"no-watchdog", [](Hm2Identity& b) { module(b, 0) = 0x010100C3; }},
    {"no-counters", [](Hm2Identity& b) { module(b, place_of_counters) = 0x020102C3; }},
    {"no-pwm", [](Hm2Identity& b) { module(b, place_of_pwm) = 0x020200C3; }},
    {"one-counter", [](Hm2Identity& b) { set_instances(b, place_of_counters, 1); }},
    {"one-pwm", [](Hm2Identity& b) { set_instances(b, place_of_pwm, 1); }},
    {"255-instances", [](Hm2Identity& b) { set_instances(b, place_of_pwm, 255); }},
    {"base-outside", [](Hm2Identity& b) { module(b, place_of_counters, 1) |= 0xFFFC; }},
    {"version", [](Hm2Identity& b) { module(b, place_of_pwm) |= 0x00000900U; }},
    {"endless",
     [](Hm2Identity& b) {
       for (std::uint32_t a = modules + 60; a < pins; a += 4) at(b, a) = 0x010100C3;
     }},
    {"pins", [](Hm2Identity& b) { at(b, pins + 4) = at(b, pins + 4 * 18) = pin(0, 0, 0); }},
    {"all-ones",
     [](Hm2Identity& b) {
       for (std::uint32_t a = 0x100; a < pins + 512; a += 4) at(b, a) = 0xFFFFFFFF;
     }},
    {"lbp-version", [](Hm2Identity& b) { b.lbp_version = 2; }},
    {"firmware", [](Hm2Identity& b) { b.firmware_version = 3; }},
}};

}  // namespace

std::string Hm2Identity::lies() {
  std::string all;
  for (const Lie& lie : lies_told) all.append(lie.name).append(" ");
  all.pop_back();
  return all;
}

Hm2Identity::Hm2Identity(std::string_view lie) : words(stock_words()) {
  if (lie.empty()) return;
  const auto told = std::ranges::find(lies_told, lie, &Lie::name);
  if (told == lies_told.end()) refuse_fault(lie, "one of " + lies());
  told->tell(*this);
}

}  // namespace abs_hil::emulator
