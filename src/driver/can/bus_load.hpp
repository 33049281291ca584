#pragma once

#include <cstdint>

namespace abs_hil::driver::can {

/// Time on the bus of frames, counted in bits, at worst: every place that bit stuffing can fill is filled.
struct FrameBits {
  int nominal{0};  ///< at the bit rate of arbitration
  int data{0};     ///< at the data bit rate of CAN FD; 0 for classic frames
};
/// Classic frame with 11-bit identifier: 44 + 8 n bits, floor((34 + 8 n - 1) / 4) stuff bits, 3 bits between frames.
[[nodiscard]] FrameBits worst_classic_frame(int bytes) noexcept;
/// CAN FD frame with 11-bit identifier and bit-rate switch (ISO 11898-1: fixed stuff bits in the CRC).
[[nodiscard]] FrameBits worst_fd_frame(int bytes) noexcept;

struct BusLoad {
  double share{0.0};     ///< of the bus's time, worst case; > 1: the bus cannot carry it
  double answer_s{0.0};  ///< from the start of the SYNC to the end of the longest answer
  double command_s{0.0};
};
/// What one run puts on the bus. Rates in Hz and bit/s, all > 0.
[[nodiscard]] BusLoad bus_load(double rate_Hz, double bit_rate, double data_bit_rate, bool fd) noexcept;

}  // namespace abs_hil::driver::can
