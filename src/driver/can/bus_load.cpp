#include "driver/can/bus_load.hpp"

#include "driver/can/protocol.hpp"

namespace abs_hil::driver::can {

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
