#pragma once

// The wire of a HostMot2 board over UDP (docs/hm2.md): its protocol LBP16, a cycle's datagrams, its descriptors.
//
// A datagram is a list of commands: a 16-bit word, a 16-bit byte address, then the data of a write, all little-endian.
//   word = write << 15 | address follows << 14 | info << 13 | space << 10 | unit (0: 8 bit, 1: 16, 2: 32) << 8 |
//   increment << 7 | units
// The board answers all reads of one datagram, in order, with one datagram; it does not answer writes.

#include <netinet/in.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_options.hpp"
#include "driver/file_descriptor.hpp"

namespace abs_hil::driver::hm2 {

inline constexpr std::uint16_t standard_port = 27181;
inline constexpr std::size_t most_bytes = 1024;  ///< of a datagram that this driver sends or takes

namespace space {
inline constexpr unsigned hostmot2 = 0;  ///< 32 bit
inline constexpr unsigned eeprom = 2;    ///< these and all below: 16 bit
inline constexpr unsigned timers = 4;
inline constexpr unsigned emulator = 5;  ///< no hardware has it; in lock-step: the time, ns, in two of 32 bit
inline constexpr unsigned status = 6;
inline constexpr unsigned board_info = 7;
inline constexpr unsigned info = 8;  ///< with one of them: about that space, from its cookie on, 16 bit
}  // namespace space

/// Addresses that do not depend on the board's descriptors.
namespace at {
inline constexpr std::uint16_t cookie = 0x0100;      ///< of HostMot2: 0x55AACAFE, then "HOSTMOT2" and the IDROM's place
inline constexpr std::uint16_t microseconds = 0x00;  ///< of the timers: free-running clock
inline constexpr std::uint16_t read_number = 0x10;   ///< of the timers: scratch, 32 bit
inline constexpr std::uint16_t write_number = 0x14;  ///< of the timers: scratch, 32 bit
inline constexpr std::uint16_t received = 0x08;      ///< of the status: packets that the board got, then those of UDP
inline constexpr std::uint16_t board_name = 0x00;    ///< of the board's info, then version of LBP16, of the firmware
inline constexpr std::uint16_t mac = 0x02;           ///< of the EEPROM: 3 words, the last byte first
}  // namespace at

/// One datagram in the making. Real-time safe.
class Packet {
 public:
  /// Asks for `units` units. Returns where the answer has them.
  std::size_t read(unsigned from_space, std::uint16_t address, unsigned units = 1) noexcept;
  void write32(std::uint16_t address, std::span<const std::uint32_t> values) noexcept;
  void write32(std::uint16_t address, std::uint32_t value) noexcept { write32(address, {&value, 1}); }
  void write_time(std::uint64_t time_ns) noexcept;
  /// Writes a number into the scratch words.
  void write_number(std::uint16_t address, std::uint32_t number) noexcept;

  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return {bytes_.data(), size_}; }
  [[nodiscard]] std::size_t answer_bytes() const noexcept { return answer_bytes_; }

 private:
  void put(std::uint32_t value, unsigned bytes) noexcept;
  void command(bool write, unsigned in_space, unsigned units, std::uint16_t address, bool increment) noexcept;

  std::array<std::uint8_t, most_bytes> bytes_{};
  std::size_t size_{0};
  std::size_t answer_bytes_{0};
};

[[nodiscard]] constexpr std::uint16_t word16(std::span<const std::uint8_t> bytes, std::size_t where) noexcept {
  return static_cast<std::uint16_t>(bytes[where] | bytes[where + 1] << 8U);
}
[[nodiscard]] constexpr std::uint32_t word32(std::span<const std::uint8_t> bytes, std::size_t where) noexcept {
  return word16(bytes, where) | static_cast<std::uint32_t>(word16(bytes, where + 2)) << 16U;
}

/// Sends and receives datagrams.
class Link {
 public:
  virtual ~Link() = default;
  /// Returns 0 or the system's error. Does not wait. Real-time safe, like `receive`.
  virtual int send(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Waits for a datagram until `deadline_ns` (CLOCK_MONOTONIC). Returns its size, cut to the buffer's; 0: none came.
  virtual std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept = 0;
};

/// The system gives no socket.
class NoSocket : public Unavailable {
 public:
  explicit NoSocket(int error);
  int errno_value;
};

/// A UDP socket that takes datagrams of the board alone.
class UdpLink final : public Link {
 public:
  /// Throws NoSocket.
  explicit UdpLink(const sockaddr_in& board);
  int send(std::span<const std::uint8_t> bytes) noexcept override;
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept override;

 private:
  FileDescriptor socket_;
};

/// Keeps the last datagrams with their times, and counts those that were sent. Real-time safe.
class RecordedLink final : public Link {
 public:
  struct Datagram {
    std::int64_t time_ns{0};
    bool sent{false};
    std::uint16_t size{0};
    std::array<std::uint8_t, 64> bytes{};  ///< its first ones
  };
  explicit RecordedLink(std::unique_ptr<Link> link) : link_(std::move(link)) {}
  int send(std::span<const std::uint8_t> bytes) noexcept override;
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept override;
  [[nodiscard]] std::uint32_t sent() const noexcept { return sent_; }
  /// The last 64, oldest first, one line each.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  void keep(bool sent, std::span<const std::uint8_t> bytes) noexcept;
  std::unique_ptr<Link> link_;
  std::uint32_t sent_{0};
  std::uint64_t kept_{0};
  std::array<Datagram, 64> datagrams_{};
};

/// "192.168.1.121" or "192.168.1.121:27181". Throws std::invalid_argument, naming the key.
[[nodiscard]] sockaddr_in parse_address(const std::string& text);

/// Sends a datagram that reads and waits for its answer; a number in the scratch words tells it from older ones. It
/// repeats the datagram up to `tries` times. False: no answer.
/// @param answer  becomes what `packet` reads
bool ask(Link& link, const Packet& packet, std::span<std::uint8_t> answer, std::uint32_t& number,
         std::int64_t wait_ns = 50'000'000, int tries = 3) noexcept;

inline constexpr unsigned most_ports = 8;
using PortWords = std::array<std::uint32_t, most_ports>;

/// How many packets the board has got since power-on; both numbers wrap.
struct Received {
  std::uint16_t all{0};
  std::uint16_t udp{0};  ///< of those; a board that does not keep it shows 0
};

/// What the datagram of a cycle reads.
struct CycleAnswer {
  std::uint16_t clock_us{0};
  PortWords levels{};
  PortWords direction{};
  std::uint32_t bitten{0};
  std::uint16_t stamp_clock{0};
  std::array<std::uint32_t, 2> count{};    ///< low half: count; high half: time stamp of the last count
  std::array<std::uint32_t, 2> control{};  ///< bit 15: quadrature error
  Received received{};
  std::uint32_t read_number{0};
  std::uint32_t write_number{0};
};

/// Addresses of two registers: of the upper wheel, then the lower; of the drive, then the brake.
using RegisterPair = std::array<std::uint16_t, 2>;
/// One command if they stand side by side, otherwise two.
void write_pair(Packet& packet, const RegisterPair& address, const std::array<std::uint32_t, 2>& values) noexcept;

/// What a write to the watchdog's pet register must be.
inline constexpr std::uint32_t reload = 0x5A000000;

/// The two datagrams of a cycle, one that reads, one that writes, and the addresses of their registers, from the
/// board's descriptors. Real-time safe.
struct CycleWire {
  unsigned ports{0};
  std::uint16_t port_data{0};
  std::uint16_t direction{0};
  std::uint16_t bitten{0};
  std::uint16_t pet{0};
  std::uint16_t stamp_clock{0};
  RegisterPair count{};
  RegisterPair control{};
  RegisterPair pwm{};

  [[nodiscard]] Packet read(std::uint32_t number) const noexcept;
  /// False: the answer has another length.
  [[nodiscard]] bool decode(std::span<const std::uint8_t> bytes, CycleAnswer& answer) const noexcept;
  /// PWM values, the watchdog's pet, the write's number.
  [[nodiscard]] Packet write(const PortWords& data, const std::array<std::uint32_t, 2>& pwm_values,
                             std::uint32_t write_number) const noexcept;
};

// A board as its own descriptors show it: cookie, IDROM, modules, pins, clocks. Nothing about it is assumed.

/// One module of the board: register k of instance i is at base + k · register_stride + i · instance_stride.
struct Module {
  unsigned instances{0};
  std::uint16_t base{0};
  std::uint16_t register_stride{0};
  std::uint16_t instance_stride{0};
  double clock_Hz{0.0};
  [[nodiscard]] std::uint16_t address(unsigned reg, unsigned instance = 0) const noexcept {
    return static_cast<std::uint16_t>(base + reg * register_stride + instance * instance_stride);
  }
};

/// What the registers of the modules are.
namespace reg {
enum Watchdog : unsigned { time, bitten, pet };
enum Port : unsigned { data, direction, alternate_source, open_drain, invert };
enum Counter : unsigned { count, control, stamp_divisor, stamp_clock, filter };
enum Pwm : unsigned { value, mode, rate, pdm_rate, enable };
}  // namespace reg

/// One of the module's functions at an I/O pin.
struct Pin {
  std::uint8_t function{0};  ///< bit 7: output
  std::uint8_t tag{0};
  std::uint8_t unit{0};
};
namespace tag {
inline constexpr std::uint8_t watchdog = 2;
inline constexpr std::uint8_t port = 3;
inline constexpr std::uint8_t counter = 4;
inline constexpr std::uint8_t pwm = 6;
inline constexpr std::uint8_t muxed_counter = 12;
inline constexpr std::uint8_t muxed_select = 13;
}  // namespace tag
// Functions of their pins.
inline constexpr std::uint8_t signal_a = 1;
inline constexpr std::uint8_t signal_b = 2;
inline constexpr std::uint8_t pwm_output = 0x81;

/// A board as it describes itself.
struct Board {
  std::string name{};  ///< "7I92"
  std::string idrom_name{};
  unsigned protocol_version{0};
  unsigned firmware_version{0};
  std::string mac{};
  double clock_low_Hz{0.0};
  double clock_high_Hz{0.0};
  unsigned ports{0};
  unsigned port_width{0};
  Module watchdog{};
  Module port{};
  Module counter{};
  Module pwm{};
  /// `counter` is the multiplexed kind: of two counters with the same pins the odd one counts while the select pin is
  /// high, as it also is when nobody drives it; the even one counts only while the board drives this pin.
  bool multiplexed{false};
  std::vector<Pin> pins{};
  std::vector<std::string> modules{};  ///< each in words
};

/// One word for each of the board's ports.
[[nodiscard]] inline std::span<const std::uint32_t> of_ports(const PortWords& words, const Board& board) noexcept {
  return {words.data(), board.ports};
}

/// Reads who the board is, all descriptors, and checks each of them. Writes nothing but the scratch word of `ask`.
/// Throws Unavailable, naming the fact, for a board that does not answer, that describes something impossible, or that
/// lacks a watchdog, two counters or two PWMs of a known version.
[[nodiscard]] Board read_board(Link& link, const std::string& place, std::uint32_t& number);

/// The pins that a rig uses, as words for the ports' registers.
struct UsedPins {
  PortWords outputs{};   ///< the direction register while active
  PortWords modules{};   ///< pins that carry their module
  PortWords inverted{};  ///< outputs that are active low
  PortWords enable{};    ///< the motor's enable line
  PortWords relay{};     ///< the line that changes with each command
};

/// Finds the pins of the options' PWMs, counters and lines.
/// Throws Unavailable, naming the key, if the board has them elsewhere or lacks them, or if a pin has two uses.
[[nodiscard]] UsedPins find_pins(const Board& board, const Hm2Options& options);

}  // namespace abs_hil::driver::hm2
