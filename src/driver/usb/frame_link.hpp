#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "driver/emulated_time.hpp"
#include "driver/usb/frame.hpp"

namespace abs_hil::driver::usb {

/// Frames to and from one board, without waiting: transfers are queued, and their outcome is told by a later call. What
/// is queued reaches the board in that order, so that an answer shows the board after all that was sent before its
/// request. Real-time safe as far as the system below it is.
class FrameLink {
 public:
  FrameLink() = default;
  FrameLink(const FrameLink&) = delete;
  FrameLink& operator=(const FrameLink&) = delete;
  virtual ~FrameLink() = default;

  /// Queues a frame for the board. `no_answer` if the board has not taken the ones before it for too long: not queued.
  virtual IoResult send(const Frame& frame) noexcept = 0;
  /// Queues the request for one frame. One at a time: only while no answer is outstanding.
  virtual IoResult request() noexcept = 0;
  [[nodiscard]] virtual bool answer_outstanding() const noexcept = 0;
  /// Waits for the outstanding answer, `timeout_ns` >= 0 at most. `no_answer`: not there yet, still outstanding. After
  /// any other result nothing is outstanding. `bytes` views the answer, of any length, until the next request.
  virtual IoResult receive(std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept = 0;
  /// Waits until the board has taken all that was sent; `no_answer` if it has not within `timeout_ns`.
  virtual IoResult flush(std::int64_t timeout_ns) noexcept = 0;
  /// Gives up what is queued and outstanding and clears what is stalled, for a fresh start. May take seconds on a board
  /// that is failing: never called by a cycle that goes well.
  virtual void recover() noexcept = 0;
};

/// A board ready for use.
struct Board {
  std::unique_ptr<FrameLink> link{};
  std::unique_ptr<EmulatedTime> time{};  ///< only behind an emulator in lock-step; made of the link, ends before it
  std::string place{};                   ///< for messages: ids, serial, bus address
};

// Bulk endpoints of the FPGA. 6 OUT and 8 IN are its JTAG: never touched.
inline constexpr std::uint8_t endpoint_out = 0x02;
inline constexpr std::uint8_t endpoint_in = 0x84;

}  // namespace abs_hil::driver::usb
