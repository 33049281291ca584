#include "driver/can/signal_codec.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::driver::can {

namespace {

constexpr unsigned bits_per_byte = 8;

/// Position of bit `number` of a signal; number 0 is the least significant bit.
unsigned place_of(const Signal& signal, unsigned number) noexcept {
  if (signal.order == ByteOrder::little_endian) return signal.start_bit + number;
  // Big-endian: from the most significant bit downwards within a byte, then from bit 7 of the next byte.
  const unsigned from_top = signal.bits - 1U - number;
  const unsigned top = (signal.start_bit / bits_per_byte) * bits_per_byte +
                       (bits_per_byte - 1U - signal.start_bit % bits_per_byte) + from_top;
  return (top / bits_per_byte) * bits_per_byte + (bits_per_byte - 1U - top % bits_per_byte);
}

}  // namespace

std::int64_t raw_value(const Frame& frame, const Signal& signal) noexcept {
  std::uint64_t raw = 0;
  for (unsigned number = 0; number < signal.bits; ++number) {
    const unsigned place = place_of(signal, number);
    const std::uint64_t bit = (frame.data[place / bits_per_byte] >> (place % bits_per_byte)) & 1U;
    raw |= bit << number;
  }
  if (signal.bits == 0) return 0;
  const std::uint64_t sign_bit = std::uint64_t{1} << (signal.bits - 1U);
  if (signal.is_signed && (raw & sign_bit) != 0) raw |= ~((sign_bit << 1U) - 1U);
  return static_cast<std::int64_t>(raw);
}

void set_raw_value(Frame& frame, const Signal& signal, std::int64_t raw) noexcept {
  const auto bits = static_cast<std::uint64_t>(raw);
  for (unsigned number = 0; number < signal.bits; ++number) {
    const unsigned place = place_of(signal, number);
    std::uint8_t& byte = frame.data[place / bits_per_byte];
    const auto mask = static_cast<std::uint8_t>(1U << (place % bits_per_byte));
    byte = static_cast<std::uint8_t>(((bits >> number) & 1U) != 0 ? byte | mask : byte & ~mask);
  }
}

double physical_value(const Signal& signal, std::int64_t raw) noexcept {
  return static_cast<double>(raw) * signal.scale + signal.offset;
}

std::int64_t nearest_raw(const Signal& signal, double physical) noexcept {
  const double within = std::clamp(physical, signal.least, signal.most);
  return std::llround((within - signal.offset) / signal.scale);
}

bool in_range(const Signal& signal, std::int64_t raw) noexcept {
  return raw >= std::llround((signal.least - signal.offset) / signal.scale) &&
         raw <= std::llround((signal.most - signal.offset) / signal.scale);
}

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

}  // namespace abs_hil::driver::can
