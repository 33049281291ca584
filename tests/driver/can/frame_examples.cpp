// Prints examples of every frame of the protocol as this code writes them, for cantools_test.py: one line a frame,
// "identifier bytes signal=raw ...", the check among the signals.
#include <algorithm>
#include <cstdio>
#include <random>

#include "driver/can/protocol.hpp"

using namespace abs_hil::driver::can;

int main() {
  std::mt19937_64 random(11);
  for (const Message& message : messages()) {
    for (int example = 0; example < 50; ++example) {
      Frame frame{.id = message.id, .length = message.bytes, .fd = message.fd_only};
      for (const Signal& signal : message.signals) {
        const std::int64_t least = least_raw(signal);
        const std::int64_t most = most_raw(signal);
        // The ends of the range first.
        const auto offset = static_cast<std::int64_t>(random() % (static_cast<std::uint64_t>(most - least) + 1));
        set_raw_value(frame, signal, example == 0 ? least : example == 1 ? most : least + offset);
      }
      frame.data[frame.length - 1U] = checksum(frame);
      std::printf("%x ", message.id);
      std::for_each_n(frame.data.begin(), frame.length, [](std::uint8_t byte) { std::printf("%02x", byte); });
      for (const Signal& signal : message.signals) {
        std::printf(" %.*s=%lld", static_cast<int>(signal.name.size()), signal.name.data(),
                    static_cast<long long>(raw_value(frame, signal)));
      }
      std::puts("");
    }
  }
}
