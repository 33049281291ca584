#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace abs_hil::driver::can {

/// The node's protocol, version 1: every message and signal. config/can/abs_rig.dbc has the same for other tools, and a
/// test compares the two. docs/can.md describes the order of the frames.
inline constexpr std::uint32_t protocol_version = 1;

enum class ByteOrder : std::uint8_t { little_endian, big_endian };

/// One signal: physical value = raw * scale + offset. `start_bit` is as in a DBC file: bit n is bit n % 8 of byte n
/// / 8. It is the least significant bit in little-endian order, the most significant bit in big-endian order.
struct Signal {
  std::string_view name;
  std::uint16_t start_bit;
  std::uint16_t bits;  ///< 1 ... 48
  bool is_signed{false};
  double scale{1.0};
  double offset{0.0};
  double least{0.0};  ///< least physical value that the decoder accepts
  double most{0.0};   ///< largest physical value that the decoder accepts
  std::string_view unit{};
  ByteOrder order{ByteOrder::little_endian};
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
inline constexpr std::uint32_t measurement = 0x094;
inline constexpr std::uint32_t identity = 0x09A;
}  // namespace id

/// Requests of ABS_CONTROL.
enum class Request : std::uint8_t { identify = 1, activate = 2, deactivate = 3 };
/// State of the node. Its outputs follow commands only in `active`. Only a new activation ends `latched`.
enum class NodeState : std::uint8_t { inactive = 0, active = 1, latched = 2 };
/// Why the node latched.
enum class LatchReason : std::uint8_t { none = 0, watchdog = 1, commands_rejected = 2 };
/// Bits of ABS_IDENTITY's features.
namespace feature {
inline constexpr std::uint8_t lock_step = 1U << 0U;  ///< an emulator whose time ABS_TIME advances
inline constexpr std::uint8_t can_fd = 1U << 1U;
}  // namespace feature

/// Raw values that mean "not known".
inline constexpr std::int64_t supply_unknown = 0xFFFF;
inline constexpr std::int64_t temperature_unknown = -32768;
/// The node sends STATUS and OUTPUTS with every n-th answer.
inline constexpr unsigned slow_frame_period = 10;

namespace signal {

inline constexpr double duty_scale = 0.0001;
inline constexpr std::uint32_t duty_steps = 10'000;  ///< raw value of duty 1
static_assert(duty_steps * duty_scale == 1.0);
inline constexpr Signal check_of_8{"Check", 56, 8, false, 1, 0, 0, 255};
inline constexpr Signal sequence_of_8{"Sequence", 48, 8, false, 1, 0, 0, 255};

inline constexpr Signal host_time{"HostTime", 0, 48, false, 1, 0, 0, 281474976710655.0, "ns"};

inline constexpr Signal sync_sequence{"Sequence", 0, 8, false, 1, 0, 0, 255};
inline constexpr Signal sync_check{"Check", 8, 8, false, 1, 0, 0, 255};

inline constexpr Signal brake_duty{"BrakeDuty", 0, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal drive_duty{"DriveDuty", 16, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal drive_enable{"DriveEnable", 32, 1, false, 1, 0, 0, 1};
inline constexpr Signal heartbeat{"Heartbeat", 40, 8, false, 1, 0, 0, 255};

inline constexpr Signal request{"Request", 0, 8, false, 1, 0, 1, 3};
inline constexpr Signal control_nonce{"Nonce", 8, 16, false, 1, 0, 0, 65535};
inline constexpr Signal watchdog_timeout{"WatchdogTimeout", 24, 16, false, 1, 0, 0, 10000, "ms"};

inline constexpr Signal trip_flags{"TripFlags", 0, 3, false, 1, 0, 0, 7};
inline constexpr Signal node_state{"NodeState", 4, 4, false, 1, 0, 0, 2};
inline constexpr Signal latch_reason{"LatchReason", 8, 8, false, 1, 0, 0, 2};
inline constexpr Signal supply{"Supply", 16, 16, false, 0.001, 0, 0, 65.535, "V"};
inline constexpr Signal temperature{"Temperature", 32, 16, true, 0.01, 0, -327.68, 300, "degC"};

inline constexpr Signal brake_applied{"BrakeApplied", 0, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal drive_applied{"DriveApplied", 16, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal rejected_commands{"RejectedCommands", 32, 8, false, 1, 0, 0, 255};
inline constexpr Signal command_sequence{"CommandSequence", 40, 8, false, 1, 0, 0, 255};

inline constexpr Signal upper_counts{"UpperCounts", 0, 24, true, 1, 0, -8388608, 8388607, "counts"};
inline constexpr Signal lower_counts{"LowerCounts", 24, 24, true, 1, 0, -8388608, 8388607, "counts"};

inline constexpr Signal node_time{"NodeTime", 0, 32, false, 1, 0, 0, 4294967295.0, "us"};
inline constexpr Signal lever_counts{"LeverCounts", 32, 12, true, 1, 0, -2048, 2047, "counts"};
inline constexpr Signal latch_state{"NodeState", 44, 4, false, 1, 0, 0, 2};

inline constexpr Signal fd_upper_counts{"UpperCounts", 0, 32, true, 1, 0, -2147483648.0, 2147483647.0, "counts"};
inline constexpr Signal fd_lower_counts{"LowerCounts", 32, 32, true, 1, 0, -2147483648.0, 2147483647.0, "counts"};
inline constexpr Signal fd_lever_counts{"LeverCounts", 64, 32, true, 1, 0, -2147483648.0, 2147483647.0, "counts"};
inline constexpr Signal fd_node_time{"NodeTime", 96, 32, false, 1, 0, 0, 4294967295.0, "us"};
inline constexpr Signal fd_brake_applied{"BrakeApplied", 128, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal fd_drive_applied{"DriveApplied", 144, 16, false, duty_scale, 0, 0, 1};
inline constexpr Signal fd_trip_flags{"TripFlags", 160, 3, false, 1, 0, 0, 7};
inline constexpr Signal fd_node_state{"NodeState", 164, 4, false, 1, 0, 0, 2};
inline constexpr Signal fd_command_sequence{"CommandSequence", 168, 8, false, 1, 0, 0, 255};
inline constexpr Signal fd_sequence{"Sequence", 176, 8, false, 1, 0, 0, 255};
inline constexpr Signal fd_check{"Check", 184, 8, false, 1, 0, 0, 255};

inline constexpr Signal protocol{"Protocol", 0, 8, false, 1, 0, 0, 255};
inline constexpr Signal features{"Features", 8, 8, false, 1, 0, 0, 3};
inline constexpr Signal identity_nonce{"Nonce", 16, 16, false, 1, 0, 0, 65535};
inline constexpr Signal identity_watchdog{"WatchdogTimeout", 32, 16, false, 1, 0, 0, 10000, "ms"};

}  // namespace signal

/// All messages, by identifier.
[[nodiscard]] std::span<const Message> messages() noexcept;
/// Null for an identifier that the protocol does not have.
[[nodiscard]] const Message* find_message(std::uint32_t identifier) noexcept;

}  // namespace abs_hil::driver::can
