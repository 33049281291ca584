#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace abs_hil::driver::can {

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

}  // namespace abs_hil::driver::can
