// LBP16 on the device side. A command is a word of 16 bits, little-endian:
//   15 write | 14 address follows | 13 info area | 12-10 space | 9-8 bytes a unit, log2 | 7 increment | 6-0 units
// Sources: Mesa's manual of the 7I92, chapter LBP16; frames that LinuxCNC exchanged with another emulator.

#include <algorithm>
#include <array>
#include <cstring>

#include "emulator/hm2_fpga.hpp"
#include "emulator/udp_board.hpp"

namespace abs_hil::emulator {

namespace {

enum Space : std::uint32_t { hostmot2, ethernet_chip, eeprom, flash, timers, lock_step, control, board_info };

struct SpaceFacts {
  char name[9];
  std::uint16_t sizes;   ///< 15 writable, 14-8 type (1 register, 2 memory, 0E EEPROM, 0F flash), 3-0 log2 unit bytes
  std::uint16_t ranges;  ///< 15-11 erase block, 10-6 page, 5-0 address bits
};
constexpr std::uint16_t writable = 0x8000;
constexpr std::array<SpaceFacts, 8> spaces{{{"HostMot2", writable | 0x0104, 16},
                                            {"KSZ8851M", writable | 0x0106, 8},
                                            {"EtherEEP", writable | 0x0E02, 7},
                                            {"FPGAFlsh", writable | 0x0104, 16 << 11 | 8 << 6 | 24},
                                            {"LBP16Tmr", writable | 0x0102, 5},
                                            {"LockStep", writable | 0x010F, 3},
                                            {"LBPCtlRg", writable | 0x0102, 5},
                                            {"BrdInfo ", 0x0202, 5}}};

constexpr std::uint32_t parse_error = 1;
constexpr std::uint32_t memory_error = 2;
constexpr std::uint32_t write_error = 4;

// Space 6.
constexpr std::uint32_t error_counts = 0x02;  // parse, memory, write
constexpr std::uint32_t rx_packets = 0x08;
constexpr std::uint32_t tx_packets = 0x0E;
constexpr std::uint32_t eeprom_enable = 0x1A;
constexpr std::uint32_t reset_register = 0x1C;
constexpr std::uint32_t reload_register = 0x1E;
constexpr std::uint32_t eeprom_key = 0x5A02;
/// Size code of the flash (16 Mbit), as the board's bootloader gives it.
constexpr std::uint32_t flash_id_address = 0x08;
constexpr std::uint32_t flash_id = 0x14;

class Hm2Board final : public Hm2Fpga {
 public:
  explicit Hm2Board(const BoardOptions& options) : Hm2Fpga(options) { start(); }

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override {
    bump(control, rx_packets);
    bump(control, rx_packets + 2);
    std::vector<std::uint8_t> reply;
    bool wrote = false;
    std::size_t at = 0;
    const auto take = [&](std::size_t count) {
      std::uint64_t value = 0;
      for (std::size_t i = count; i > 0; --i) value = value << 8U | datagram[at + i - 1];
      at += count;
      return value;
    };
    while (at < datagram.size()) {
      const std::size_t left = datagram.size() - at;
      const bool has_address = left >= 2 && (datagram[at + 1] & 0x40U) != 0;
      if (left < (has_address ? 4U : 2U)) {
        count_error(parse_error);
        break;
      }
      const Access access = decoded(static_cast<std::uint32_t>(take(2)));
      std::uint32_t address = has_address ? static_cast<std::uint32_t>(take(2)) : pointers_[access.space];
      const std::size_t size = std::size_t{access.units} * access.unit_bytes;
      if (access.write ? datagram.size() - at < size : reply.size() + size > largest_hm2_answer) {
        count_error(parse_error);
        break;
      }
      const bool taken = takes(access);
      if (!taken) count_error(memory_error);
      wrote = wrote || (access.write && access.space != timers && access.space != lock_step);
      for (std::uint32_t unit = 0; unit < access.units; ++unit) {
        if (access.write) {
          const std::uint64_t value = take(access.unit_bytes);
          if (taken) write(access, address, value);
        } else {
          const std::uint64_t value = taken ? read(access, address) : 0;
          for (std::uint32_t i = 0; i < access.unit_bytes; ++i) {
            reply.push_back(static_cast<std::uint8_t>(value >> 8U * i));
          }
        }
        if (access.increment) address = (address + access.unit_bytes) & 0xFFFFU;
      }
      if (!access.info) pointers_[access.space] = address;
    }
    if (wrote) ++writes_;
    if (!reply.empty()) {
      bump(control, tx_packets);
      bump(control, tx_packets + 2);
    }
    return reply;
  }
  void power_cycle() override { start(); }

 private:
  static constexpr std::uint32_t space_count = 8;
  static constexpr std::uint32_t memory_bytes = 0x80;
  struct Access {
    bool write, info, increment;
    std::uint32_t space, unit_bytes, units;
  };
  using Memory = std::array<std::uint8_t, memory_bytes>;

  void start() {
    memory_ = {};
    pointers_ = {};
    power_on_ns_ = time_ns();
    for (std::uint32_t i = 0; i < options_.name.size(); ++i) {
      memory_[board_info][i] = memory_[eeprom][0x10 + i] = static_cast<std::uint8_t>(options_.name[i]);
    }
    put(board_info, 0x10, 2, identity_.lbp_version);
    put(board_info, 0x12, 2, identity_.firmware_version);
    for (std::uint32_t i = 0; i < options_.mac.size(); ++i) memory_[eeprom][2 + i] = options_.mac[5 - i];
    for (std::uint32_t i = 0; i < options_.address.size(); ++i) memory_[eeprom][0x20 + i] = options_.address[3 - i];
    power_on();
  }
  [[nodiscard]] static Access decoded(std::uint32_t command) noexcept {
    return {.write = (command & 0x8000U) != 0,
            .info = (command & 0x2000U) != 0,
            .increment = (command & 0x80U) != 0,
            .space = command >> 10U & 7U,
            .unit_bytes = 1U << (command >> 8U & 3U),
            .units = command & 0x7FU};
  }
  [[nodiscard]] bool takes(const Access& access) const noexcept {
    if (access.space == lock_step && !options_.lock_step && !access.info) return false;
    if (access.info) return !access.write && access.unit_bytes == 2;
    const SpaceFacts& facts = spaces[access.space];
    const std::uint32_t any = access.space == flash ? 0x07U : facts.sizes & 0x0FU;
    return (any & access.unit_bytes) != 0;
  }
  [[nodiscard]] std::uint32_t info_word(std::uint32_t space, std::uint32_t address) const noexcept {
    const SpaceFacts& facts = spaces[space];
    const bool absent = space == lock_step && !options_.lock_step;
    std::array<std::uint16_t, 8> words{static_cast<std::uint16_t>(0x5A00U + space),
                                       absent ? std::uint16_t{0} : facts.sizes, facts.ranges,
                                       static_cast<std::uint16_t>(pointers_[space])};
    std::memcpy(&words[4], facts.name, 8);
    return address % 2 == 0 && address / 2 < words.size() ? words[address / 2] : 0;
  }
  [[nodiscard]] std::uint64_t read(const Access& access, std::uint32_t address) const noexcept {
    if (access.info) return info_word(access.space, address);
    if (access.space == hostmot2) return read32(address & 0xFFFCU);
    if (access.space == flash) return address == flash_id_address ? flash_id : 0;
    if (access.space == timers && address == 0) {
      return static_cast<std::uint64_t>((time_ns() - power_on_ns_) / 1000) & 0xFFFFU;
    }
    if (access.space == lock_step) {
      Memory time{};
      for (std::uint32_t i = 0; i < 8; ++i) time[i] = static_cast<std::uint8_t>(time_ns() >> 8U * i);
      return bytes(time, address, access.unit_bytes);
    }
    return bytes(memory_[access.space], address, access.unit_bytes);
  }
  void write(const Access& access, std::uint32_t address, std::uint64_t value) {
    if (access.space == hostmot2) return write32(address & 0xFFFCU, static_cast<std::uint32_t>(value));
    const bool read_only = access.space == board_info || access.space == flash || access.space == ethernet_chip;
    const bool locked = access.space == eeprom && bytes(memory_[control], eeprom_enable, 2) != eeprom_key;
    if (read_only || locked) return count_error(write_error);
    put(access.space, address, access.unit_bytes, value);
    if (access.space == eeprom) put(control, eeprom_enable, 2, 0);  // the key opens it for one write
    const bool asks = access.space == control && bytes(memory_[control], address, 2) != 0;
    if (asks && address == reset_register) return power_cycle();
    if (asks && address == reload_register) {
      put(control, address, 2, 0);
      power_on();
    }
    if (access.space == lock_step && address + access.unit_bytes == 8) {
      advance_to(static_cast<std::int64_t>(std::min<std::uint64_t>(
          bytes(memory_[lock_step], 0, 8), static_cast<std::uint64_t>(time_ns()) + 10'000'000'000U)));
    }
  }
  void count_error(std::uint32_t bit) {
    memory_[control][0] = static_cast<std::uint8_t>(memory_[control][0] | bit);
    bump(control, bit == parse_error ? error_counts : bit == memory_error ? error_counts + 2 : error_counts + 4);
  }
  void bump(std::uint32_t space, std::uint32_t address) noexcept {
    put(space, address, 2, bytes(memory_[space], address, 2) + 1);
  }
  [[nodiscard]] static std::uint64_t bytes(const Memory& memory, std::uint32_t address, std::uint32_t count) noexcept {
    std::uint64_t value = 0;
    for (std::uint32_t i = count; i > 0; --i) {
      const std::uint32_t place = address + i - 1;
      value = value << 8U | (place < memory.size() ? memory[place] : 0U);
    }
    return value;
  }
  void put(std::uint32_t space, std::uint32_t address, std::uint32_t count, std::uint64_t value) noexcept {
    for (std::uint32_t i = 0; i < count && address + i < memory_bytes; ++i) {
      memory_[space][address + i] = static_cast<std::uint8_t>(value >> 8U * i);
    }
  }

  std::array<Memory, space_count> memory_{};
  std::array<std::uint32_t, space_count> pointers_{};
  std::int64_t power_on_ns_{0};
};

// What a board with firmware G540x2 says about itself.
constexpr std::uint32_t idrom = 0x400;
constexpr std::uint32_t modules = 0x440;
constexpr std::uint32_t pins = 0x600;
constexpr std::uint32_t pin_count = 34;

/// Module descriptors in the order of the recording with LinuxCNC: watchdog, I/O ports, counters, PWM, LEDs.
constexpr std::array<std::uint32_t, 15> module_table{
    0x01010002, 0x00030C00, 0x00,   // watchdog: 1 instance on ClockLow, 3 registers at 0C00
    0x02010003, 0x00051000, 0x1F,   // I/O ports: 2 instances, 5 registers at 1000, all of them per port
    0x02010204, 0x00053000, 0x03,   // counters: version 2, 2 instances, count and control per counter
    0x02020006, 0x00054000, 0x03,   // PWM on ClockHigh: 2 instances, value and mode per generator
    0x01010080, 0x00010200, 0x00};  // LEDs

constexpr std::uint32_t pin(std::uint32_t number, std::uint32_t tag, std::uint32_t unit) {
  return 0x03000000U | unit << 16U | tag << 8U | number;
}

std::vector<std::uint32_t> stock_words() {
  std::vector<std::uint32_t> words(pins / 4 + 512 / 4, 0);
  words[0x100 / 4] = 0x55AACAFE;
  std::memcpy(&words[0x104 / 4], "HOSTMOT2", 8);
  words[0x10C / 4] = idrom;
  const std::array<std::uint32_t, 16> header{3,   modules - idrom, pins - idrom, 0,           0,  // its name follows
                                             9,                                                   // size of the FPGA
                                             144,                                                 // its pins
                                             2,   pin_count,       17,           100'000'000, 200'000'000, 4, 64, 256,
                                             4};
  std::copy(header.begin(), header.end(), words.begin() + idrom / 4);
  std::memcpy(&words[idrom / 4 + 3], "MESA7I92", 8);
  std::copy(module_table.begin(), module_table.end(), words.begin() + modules / 4);
  for (std::uint32_t io = 0; io < pin_count; ++io) words[pins / 4 + io] = pin(0, 0, 0);
  for (std::uint32_t unit = 0; unit < 2; ++unit) {
    const std::uint32_t first = pins / 4 + unit * 17;
    words[first + 1] = pin(0x81, 6, unit);
    for (std::uint32_t line = 0; line < 3; ++line) words[first + 13 + line] = pin(line + 1, 4, unit);
  }
  return words;
}

}  // namespace

std::unique_ptr<UdpBoard> hm2_board(const BoardOptions& options) { return std::make_unique<Hm2Board>(options); }

Hm2Identity::Hm2Identity(const Hm2Words& others) : words(stock_words()) {
  for (const auto& [address, value] : others) words.at(address / 4) = value;
}

}  // namespace abs_hil::emulator
