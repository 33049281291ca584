// The node's protocol, version 1: every message and signal as one table, frames to and from it, the load of the bus.
// config/can/abs_rig.dbc has the same for other tools, and a test compares the two. docs/can.md, "Protocol", describes
// the order of the frames.

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace abs_hil::driver::can {

inline constexpr std::uint32_t protocol_version = 1;

/// One frame from or to the bus. Trivially copyable.
struct Frame {
  static constexpr std::size_t most_bytes = 64;

  std::uint32_t id{0};     ///< 11 bits; for an error frame the kernel's error class (linux/can/error.h)
  std::uint8_t length{0};  ///< bytes of data, 0 ... 8, for CAN FD 0 ... 64
  bool fd{false};
  bool error{false};            ///< an error frame: the kernel reports the controller's state
  std::int64_t received_ns{0};  ///< when the kernel received it, monotonic clock; 0: not known
  std::array<std::uint8_t, most_bytes> data{};
};

/// Identifiers. A lower one has priority on the bus.
namespace id {
inline constexpr std::uint32_t time = 0x07F;
inline constexpr std::uint32_t sync = 0x080;
inline constexpr std::uint32_t command = 0x081;
inline constexpr std::uint32_t control = 0x082;
inline constexpr std::uint32_t status = 0x090;
inline constexpr std::uint32_t outputs = 0x091;
inline constexpr std::uint32_t encoders = 0x092;
inline constexpr std::uint32_t latch = 0x093;
inline constexpr std::uint32_t measurement = 0x094;  ///< CAN FD: encoders, latch and outputs in one message
inline constexpr std::uint32_t identity = 0x09A;
}  // namespace id

/// Requests of ABS_CONTROL.
enum class Request : std::uint8_t { identify = 1, activate = 2, deactivate = 3 };
/// State of the node. Its outputs follow commands only in `active`. Only a new activation ends `latched`.
enum class NodeState : std::uint8_t { inactive = 0, active = 1, latched = 2 };
/// Bits of ABS_IDENTITY's features.
namespace feature {
inline constexpr std::int64_t lock_step = 1U << 0U;  ///< an emulator whose time ABS_TIME advances
inline constexpr std::int64_t can_fd = 1U << 1U;
inline constexpr std::int64_t emulator = 1U << 2U;  ///< no firmware sets it
}  // namespace feature

/// The node sends STATUS and OUTPUTS with every n-th answer.
inline constexpr unsigned slow_frame_period = 10;
inline constexpr std::uint32_t duty_steps = 10'000;  ///< raw value of duty 1
/// Raw values that mean "not known".
inline constexpr std::int64_t supply_unknown = 0xFFFF;
inline constexpr std::int64_t temperature_unknown = -32768;

/// Raw values of a message's signals. Those that the message does not have are 0.
struct Values {
  std::int64_t host_time_ns{0};
  std::int64_t brake_duty{0};  ///< of a command; in OUTPUTS and MEASUREMENT the one that acts
  std::int64_t drive_duty{0};
  std::int64_t drive_enable{0};
  std::int64_t heartbeat{0};  ///< sequence of the measurement from which the command was computed
  std::int64_t request{0};
  std::int64_t nonce{0};        ///< of the node's latest IDENTITY
  std::int64_t watchdog_ms{0};  ///< in CONTROL, 0: unchanged
  std::int64_t trip_flags{0};
  std::int64_t node_state{0};
  std::int64_t latch_reason{0};  ///< 0 none, 1 watchdog, 2 commands rejected
  std::int64_t supply{0};
  std::int64_t temperature{0};
  std::int64_t rejected{0};          ///< commands rejected since power-on, modulo 256
  std::int64_t command_sequence{0};  ///< of the last command accepted
  std::int64_t upper_counts{0};      ///< 24 bits, in MEASUREMENT 32; wrapping
  std::int64_t lower_counts{0};
  std::int64_t lever_counts{0};  ///< 12 bits, in MEASUREMENT 32; wrapping
  std::int64_t node_time_us{0};  ///< node's clock at the moment when it latched the counters
  std::int64_t protocol{0};
  std::int64_t features{0};
  std::int64_t sequence{0};  ///< of SYNC and of the answer to it; in COMMAND and CONTROL of the command

  [[nodiscard]] NodeState state() const noexcept { return static_cast<NodeState>(node_state); }
  [[nodiscard]] bool any_duty() const noexcept { return brake_duty != 0 || drive_duty != 0; }
  [[nodiscard]] double supply_V() const noexcept;       ///< NaN: the node does not know it
  [[nodiscard]] double temperature_C() const noexcept;  ///< NaN: the node does not know it
};

/// One signal: physical value = raw * scale. `start_bit` is as in a DBC file: bit n is bit n % 8 of byte n / 8, and the
/// signal's least significant one (little-endian).
struct Signal {
  std::string_view name;
  std::uint16_t start_bit;
  std::uint16_t bits;           ///< 1 ... 48
  std::int64_t Values::*value;  ///< null: the check
  double least{0.0};            ///< least physical value that the decoder accepts
  double most{0.0};             ///< largest physical value that the decoder accepts
  std::string_view unit{};
  double scale{1.0};
  bool is_signed{false};
};

/// One message with an 11-bit identifier. Its last byte is its checksum (`checksum`).
struct Message {
  std::uint32_t id;
  std::string_view name;
  std::uint8_t bytes;
  bool from_node;
  bool fd_only;
  std::span<const Signal> signals;
};

/// All messages, by identifier.
[[nodiscard]] std::span<const Message> messages() noexcept;
/// Null for an identifier that the protocol does not have.
[[nodiscard]] const Message* find_message(std::uint32_t identifier) noexcept;

// Real-time safe, like all functions from here on.

/// Raw value of a signal. The frame must be long enough for it.
[[nodiscard]] std::int64_t raw_value(const Frame& frame, const Signal& signal) noexcept;
void set_raw_value(Frame& frame, const Signal& signal, std::int64_t raw) noexcept;
/// Ends of the signal's range.
[[nodiscard]] std::int64_t least_raw(const Signal& signal) noexcept;
[[nodiscard]] std::int64_t most_raw(const Signal& signal) noexcept;

/// CRC-8 SAE J1850 (polynomial 0x1D, start and final exclusive-or 0xFF) over the identifier's two bytes, low first, and
/// all data but the last byte. `frame.length` >= 1.
[[nodiscard]] std::uint8_t checksum(const Frame& frame) noexcept;

/// The frame of a message of the protocol with these values, and its checksum.
[[nodiscard]] Frame frame_of(std::uint32_t identifier, const Values& values) noexcept;
/// ABS_CONTROL with this request and nothing else.
[[nodiscard]] inline Frame control_frame(Request request) noexcept {
  return frame_of(id::control, {.request = static_cast<std::int64_t>(request)});
}

enum class DecodeError : std::uint8_t {
  none = 0,
  unknown_identifier,  ///< not a message of the node
  wrong_length,        ///< wrong length, or wrong format (classic, FD) for this message
  wrong_check,         ///< wrong checksum: the frame is damaged or from another protocol
  out_of_range,        ///< the value of a signal is outside its range
};
struct Decoded {
  DecodeError error{DecodeError::none};
  std::uint32_t id{0};  ///< 0 on error
  Values values{};      ///< all 0 on error
};
/// Decodes any frame to a message of the node, or to an error.
[[nodiscard]] Decoded decode(const Frame& frame) noexcept;

/// True for a frame that commands the node, whether or not the node takes it. Received, it is from another sender: a
/// socket does not receive its own frames.
[[nodiscard]] bool commands_node(const Frame& frame) noexcept;

/// Worst-case length of a frame on the bus, in bits: bit stuffing adds every possible bit.
struct FrameBits {
  int nominal{0};  ///< at the bit rate of arbitration
  int data{0};     ///< at the data bit rate of CAN FD; 0 for classic frames
};
/// Classic frame with 11-bit identifier: 44 + 8 n bits, floor((34 + 8 n - 1) / 4) stuff bits, 3 bits between frames.
[[nodiscard]] FrameBits worst_classic_frame(int bytes) noexcept;
/// CAN FD frame with 11-bit identifier and bit-rate switch (ISO 11898-1: fixed stuff bits in the CRC).
[[nodiscard]] FrameBits worst_fd_frame(int bytes) noexcept;

struct BusLoad {
  double share{0.0};     ///< worst-case share of the bus' time; > 1: the bus cannot carry it
  double answer_s{0.0};  ///< from the start of the SYNC to the end of the longest answer
  double command_s{0.0};
};
/// Bus load of one run. Rates in Hz and bit/s, all > 0.
[[nodiscard]] BusLoad bus_load(double rate_Hz, double bit_rate, double data_bit_rate, bool fd) noexcept;

}  // namespace abs_hil::driver::can
