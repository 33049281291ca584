#pragma once

#include <cstdint>

#include "driver/can/frame.hpp"
#include "driver/can/protocol.hpp"

namespace abs_hil::driver::can {

/// Raw value of a signal. The frame must be long enough for it. Real-time safe, like all functions here.
[[nodiscard]] std::int64_t raw_value(const Frame& frame, const Signal& signal) noexcept;
void set_raw_value(Frame& frame, const Signal& signal, std::int64_t raw) noexcept;

/// True if a raw value is within the signal's range.
[[nodiscard]] bool in_range(const Signal& signal, std::int64_t raw) noexcept;
[[nodiscard]] double physical_value(const Signal& signal, std::int64_t raw) noexcept;
/// The nearest raw value; a value outside the range gives the nearest end.
[[nodiscard]] std::int64_t nearest_raw(const Signal& signal, double physical) noexcept;

/// CRC-8 SAE J1850 (polynomial 0x1D, start and final exclusive-or 0xFF) over the identifier's two bytes, low first, and
/// all data but the last byte. `frame.length` >= 1.
[[nodiscard]] std::uint8_t checksum(const Frame& frame) noexcept;

}  // namespace abs_hil::driver::can
