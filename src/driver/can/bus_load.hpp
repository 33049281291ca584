#pragma once

#include <cstdint>

namespace abs_hil::driver::can {

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
