// The load of the CAN bus: worst-case stuffing of a frame, and the documented configurations.
#include <vector>

#include "catch.hpp"
#include "driver/can/protocol.hpp"

using namespace abs_hil::driver::can;
using Catch::Matchers::WithinRel;

namespace {

/// Bits on the wire of a stuffed sequence whose first bit counts as the start, by stuffing it.
int stuffed_length(const std::vector<bool>& bits) {
  int length = 0;
  int run = 0;
  bool last = true;  // recessive before the start
  for (const bool bit : bits) {
    run = bit == last ? run + 1 : 1;
    last = bit;
    ++length;
    if (run == 5) {
      ++length;
      last = !last;
      run = 1;
    }
  }
  return length;
}

}  // namespace

TEST_CASE("The worst classic frame, stuffed bit by bit, has the length of the formula") {
  for (int bytes = 0; bytes <= 8; ++bytes) {
    // Start of frame to CRC: 34 + 8 n bits; the worst has 00000 1111 0000 1111 ...
    std::vector<bool> bits(5, false);
    bool level = true;
    while (static_cast<int>(bits.size()) < 34 + 8 * bytes) {
      for (int i = 0; i < 4 && static_cast<int>(bits.size()) < 34 + 8 * bytes; ++i) bits.push_back(level);
      level = !level;
    }
    constexpr int behind_crc = 1 + 2 + 7 + 3;  // delimiter, acknowledgement, end, between frames
    CHECK(worst_classic_frame(bytes).nominal == stuffed_length(bits) + behind_crc);
  }
  CHECK(worst_classic_frame(8).nominal == 135);  // the well-known value
}

TEST_CASE("Load of the documented configurations") {
  const BusLoad classic = bus_load(1000, 1e6, 0, false);
  CHECK_THAT(classic.share, WithinRel(1000 * (75 + 135 + 135 + 135 + 2 * 13.5) * 1e-6, 1e-12));
  CHECK_THAT(classic.answer_s, WithinRel((75 + 3 * 135) * 1e-6, 1e-12));
  CHECK(bus_load(1000, 500e3, 0, false).share > 1.0);
  CHECK(bus_load(500, 500e3, 0, false).share < 0.6);
  const BusLoad fd = bus_load(1000, 1e6, 5e6, true);
  CHECK(fd.share < 0.5 * classic.share);
  CHECK(bus_load(3000, 1e6, 5e6, true).share < 0.8);
}
