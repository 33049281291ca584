// Packs and unpacks the node's messages by their table.
#include "driver/can/protocol.hpp"

#include <cmath>
#include <cstring>
#include <limits>

namespace abs_hil::driver::can {

namespace {

using V = Values;

constexpr double byte_most = 255;
constexpr double word_most = 65535;
constexpr double duty_scale = 0.0001;
static_assert(duty_steps * duty_scale == 1.0);
constexpr double supply_scale_V = 0.001;
constexpr double temperature_scale_C = 0.01;
constexpr double watchdog_most_ms = 10'000;

constexpr Signal check_at(std::uint16_t start_bit) { return {"Check", start_bit, 8, nullptr, 0, byte_most}; }
constexpr Signal check_of_8 = check_at(56);
constexpr Signal sequence_of_8{"Sequence", 48, 8, &V::sequence, 0, byte_most};

constexpr std::array time_signals{Signal{"HostTime", 0, 48, &V::host_time_ns, 0, 281474976710655.0, "ns"}, check_of_8};
constexpr std::array sync_signals{Signal{"Sequence", 0, 8, &V::sequence, 0, byte_most}, check_at(8)};
constexpr std::array command_signals{Signal{"BrakeDuty", 0, 16, &V::brake_duty, 0, 1, "", duty_scale},
                                     Signal{"DriveDuty", 16, 16, &V::drive_duty, 0, 1, "", duty_scale},
                                     Signal{"DriveEnable", 32, 1, &V::drive_enable, 0, 1},
                                     Signal{"Heartbeat", 40, 8, &V::heartbeat, 0, byte_most},
                                     sequence_of_8,
                                     check_of_8};
constexpr std::array control_signals{
    Signal{"Request", 0, 8, &V::request, 1, 3}, Signal{"Nonce", 8, 16, &V::nonce, 0, word_most},
    Signal{"WatchdogTimeout", 24, 16, &V::watchdog_ms, 0, watchdog_most_ms, "ms"}, sequence_of_8, check_of_8};
constexpr std::array status_signals{
    Signal{"TripFlags", 0, 3, &V::trip_flags, 0, 7},
    Signal{"NodeState", 4, 4, &V::node_state, 0, 2},
    Signal{"LatchReason", 8, 8, &V::latch_reason, 0, 2},
    Signal{"Supply", 16, 16, &V::supply, 0, 65.535, "V", supply_scale_V},
    Signal{"Temperature", 32, 16, &V::temperature, -327.68, 300, "degC", temperature_scale_C, true},
    sequence_of_8,
    check_of_8};
constexpr std::array outputs_signals{Signal{"BrakeApplied", 0, 16, &V::brake_duty, 0, 1, "", duty_scale},
                                     Signal{"DriveApplied", 16, 16, &V::drive_duty, 0, 1, "", duty_scale},
                                     Signal{"RejectedCommands", 32, 8, &V::rejected, 0, byte_most},
                                     Signal{"CommandSequence", 40, 8, &V::command_sequence, 0, byte_most},
                                     sequence_of_8,
                                     check_of_8};
constexpr double least_24 = -8388608;
constexpr double most_24 = 8388607;
constexpr std::array encoders_signals{
    Signal{"UpperCounts", 0, 24, &V::upper_counts, least_24, most_24, "counts", 1, true},
    Signal{"LowerCounts", 24, 24, &V::lower_counts, least_24, most_24, "counts", 1, true}, sequence_of_8, check_of_8};
constexpr double most_unsigned_32 = 4294967295.0;
constexpr std::array latch_signals{Signal{"NodeTime", 0, 32, &V::node_time_us, 0, most_unsigned_32, "us"},
                                   Signal{"LeverCounts", 32, 12, &V::lever_counts, -2048, 2047, "counts", 1, true},
                                   Signal{"NodeState", 44, 4, &V::node_state, 0, 2}, sequence_of_8, check_of_8};
constexpr double least_32 = -2147483648.0;
constexpr double most_32 = 2147483647.0;
constexpr std::array measurement_signals{
    Signal{"UpperCounts", 0, 32, &V::upper_counts, least_32, most_32, "counts", 1, true},
    Signal{"LowerCounts", 32, 32, &V::lower_counts, least_32, most_32, "counts", 1, true},
    Signal{"LeverCounts", 64, 32, &V::lever_counts, least_32, most_32, "counts", 1, true},
    Signal{"NodeTime", 96, 32, &V::node_time_us, 0, most_unsigned_32, "us"},
    Signal{"BrakeApplied", 128, 16, &V::brake_duty, 0, 1, "", duty_scale},
    Signal{"DriveApplied", 144, 16, &V::drive_duty, 0, 1, "", duty_scale},
    Signal{"TripFlags", 160, 3, &V::trip_flags, 0, 7},
    Signal{"NodeState", 164, 4, &V::node_state, 0, 2},
    Signal{"CommandSequence", 168, 8, &V::command_sequence, 0, byte_most},
    Signal{"Sequence", 176, 8, &V::sequence, 0, byte_most},
    check_at(184)};
constexpr std::array identity_signals{
    Signal{"Protocol", 0, 8, &V::protocol, 0, byte_most}, Signal{"Features", 8, 8, &V::features, 0, 3},
    Signal{"Nonce", 16, 16, &V::nonce, 0, word_most},
    Signal{"WatchdogTimeout", 32, 16, &V::watchdog_ms, 0, watchdog_most_ms, "ms"}, check_of_8};

constexpr std::array table{
    Message{id::time, "ABS_TIME", 8, false, false, time_signals},
    Message{id::sync, "ABS_SYNC", 2, false, false, sync_signals},
    Message{id::command, "ABS_COMMAND", 8, false, false, command_signals},
    Message{id::control, "ABS_CONTROL", 8, false, false, control_signals},
    Message{id::status, "ABS_STATUS", 8, true, false, status_signals},
    Message{id::outputs, "ABS_OUTPUTS", 8, true, false, outputs_signals},
    Message{id::encoders, "ABS_ENCODERS", 8, true, false, encoders_signals},
    Message{id::latch, "ABS_LATCH", 8, true, false, latch_signals},
    Message{id::measurement, "ABS_MEASUREMENT", 24, true, true, measurement_signals},
    Message{id::identity, "ABS_IDENTITY", 8, true, false, identity_signals},
};

constexpr unsigned bits_per_byte = 8;

std::uint64_t mask_of(const Signal& signal) noexcept { return (std::uint64_t{1} << signal.bits) - 1U; }

/// From the one in which the signal begins; it ends in them. Little-endian, as the signals and every machine that this
/// is built for.
std::uint64_t eight_bytes(const Frame& frame, const Signal& signal) noexcept {
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, &frame.data[signal.start_bit / bits_per_byte], sizeof bytes);
  return bytes;
}

double physical_or_nan(std::int64_t raw, double scale, std::int64_t unknown) noexcept {
  return raw == unknown ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(raw) * scale;
}

}  // namespace

double Values::supply_V() const noexcept { return physical_or_nan(supply, supply_scale_V, supply_unknown); }
double Values::temperature_C() const noexcept {
  return physical_or_nan(temperature, temperature_scale_C, temperature_unknown);
}

std::span<const Message> messages() noexcept { return table; }

const Message* find_message(std::uint32_t identifier) noexcept {
  for (const Message& message : table) {
    if (message.id == identifier) return &message;
  }
  return nullptr;
}

std::int64_t raw_value(const Frame& frame, const Signal& signal) noexcept {
  std::uint64_t raw = eight_bytes(frame, signal) >> (signal.start_bit % bits_per_byte) & mask_of(signal);
  const std::uint64_t sign_bit = std::uint64_t{1} << (signal.bits - 1U);
  if (signal.is_signed && (raw & sign_bit) != 0) raw |= ~mask_of(signal);
  return static_cast<std::int64_t>(raw);
}

void set_raw_value(Frame& frame, const Signal& signal, std::int64_t raw) noexcept {
  const unsigned shift = signal.start_bit % bits_per_byte;
  const std::uint64_t others = eight_bytes(frame, signal) & ~(mask_of(signal) << shift);
  const std::uint64_t bytes = others | (static_cast<std::uint64_t>(raw) & mask_of(signal)) << shift;
  std::memcpy(&frame.data[signal.start_bit / bits_per_byte], &bytes, sizeof bytes);
}

std::int64_t least_raw(const Signal& signal) noexcept { return std::llround(signal.least / signal.scale); }
std::int64_t most_raw(const Signal& signal) noexcept { return std::llround(signal.most / signal.scale); }

std::uint8_t checksum(const Frame& frame) noexcept {
  constexpr unsigned polynomial = 0x1D;
  constexpr unsigned top_bit = 0x80;
  unsigned crc = 0xFF;
  const auto add = [&crc](unsigned byte) {
    crc ^= byte & 0xFFU;
    for (unsigned bit = 0; bit < bits_per_byte; ++bit) {
      crc = ((crc & top_bit) != 0 ? (crc << 1U) ^ polynomial : crc << 1U) & 0xFFU;
    }
  };
  add(frame.id);
  add(frame.id >> bits_per_byte);
  for (unsigned i = 0; i + 1 < frame.length && i + 1 < Frame::most_bytes; ++i) add(frame.data[i]);
  return static_cast<std::uint8_t>(crc ^ 0xFFU);
}

Frame frame_of(std::uint32_t identifier, const Values& values) noexcept {
  const Message& message = *find_message(identifier);
  Frame frame{.id = identifier, .length = message.bytes, .fd = message.fd_only};
  for (const Signal& signal : message.signals) {
    if (signal.value != nullptr) set_raw_value(frame, signal, values.*signal.value);
  }
  frame.data[frame.length - 1U] = checksum(frame);
  return frame;
}

Decoded decode(const Frame& frame) noexcept {
  const Message* message = frame.error ? nullptr : find_message(frame.id);
  if (message == nullptr || !message->from_node) return {DecodeError::unknown_identifier};
  if (frame.length != message->bytes || (message->fd_only && !frame.fd)) return {DecodeError::wrong_length};
  if (frame.data[frame.length - 1U] != checksum(frame)) return {DecodeError::wrong_check};
  Decoded decoded{.id = frame.id};
  for (const Signal& signal : message->signals) {
    const std::int64_t raw = raw_value(frame, signal);
    if (raw < least_raw(signal) || raw > most_raw(signal)) return {DecodeError::out_of_range};
    if (signal.value != nullptr) decoded.values.*signal.value = raw;
  }
  return decoded;
}

bool commands_node(const Frame& frame) noexcept {
  const bool asks_only = frame.data[0] == static_cast<std::uint8_t>(Request::identify);
  return !frame.error && (frame.id == id::command || (frame.id == id::control && !asks_only));
}

FrameBits worst_classic_frame(int bytes) noexcept {
  constexpr int frame = 44;    // start of frame ... end of frame
  constexpr int stuffed = 34;  // of them, those subject to stuffing, data aside
  constexpr int between = 3;
  return {.nominal = frame + between + 8 * bytes + (stuffed + 8 * bytes - 1) / 4};
}

FrameBits worst_fd_frame(int bytes) noexcept {
  constexpr int head = 17;             // start, identifier, RRS, IDE, FDF, res, BRS
  constexpr int tail = 1 + 2 + 7 + 3;  // CRC delimiter, acknowledgement with its delimiter, end, between frames
  constexpr int most_bytes_of_short_crc = 16;
  const int crc = bytes <= most_bytes_of_short_crc ? 17 : 21;
  const int stuffed = 1 + 4 + 8 * bytes;          // ESI, length, data
  const int check = 4 + crc + (4 + crc + 3) / 4;  // stuff count, CRC, a fixed stuff bit before each four
  return {.nominal = head + (head - 1) / 4 + tail, .data = stuffed + (stuffed + 1) / 4 + check};
}

BusLoad bus_load(double rate_Hz, double bit_rate, double data_bit_rate, bool fd) noexcept {
  const auto seconds = [&](int bytes) {
    const FrameBits bits = fd ? worst_fd_frame(bytes) : worst_classic_frame(bytes);
    return bits.nominal / bit_rate + bits.data / (data_bit_rate > 0.0 ? data_bit_rate : bit_rate);
  };
  const auto of = [&](std::uint32_t identifier) { return seconds(find_message(identifier)->bytes); };
  const double sync_s = of(id::sync);
  const double slow_s = of(id::status);  // OUTPUTS has the same length
  const double measured_s = fd ? of(id::measurement) : of(id::encoders) + of(id::latch);
  const int slow_frames = fd ? 1 : 2;
  BusLoad load{.answer_s = sync_s + slow_s + measured_s, .command_s = of(id::command)};
  load.share = rate_Hz * (sync_s + measured_s + load.command_s + slow_frames * slow_s / slow_frame_period);
  return load;
}

}  // namespace abs_hil::driver::can
