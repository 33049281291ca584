#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/usb/frame.hpp"

namespace abs_hil::driver::usb {

/// Frames to and from one board without waiting: a call queues a transfer, and a later call returns its result.
/// Transfers reach the board in the order of queueing. An answer therefore includes the effect of all frames sent
/// before its request. As real-time safe as the system below it.
class FrameLink {
 public:
  FrameLink() = default;
  FrameLink(const FrameLink&) = delete;
  FrameLink& operator=(const FrameLink&) = delete;
  virtual ~FrameLink() = default;

  /// Queues a frame for the board. `no_answer`: not queued, because the board has not taken the previous ones for too
  /// long.
  virtual IoResult send(const Frame& frame) noexcept = 0;
  /// Queues the request for one frame. Call it only while no answer is outstanding.
  virtual IoResult request() noexcept = 0;
  [[nodiscard]] virtual bool answer_outstanding() const noexcept = 0;
  /// Waits for the outstanding answer, at most `timeout_ns` >= 0. `no_answer`: it has not come yet and stays
  /// outstanding. After any other result of its own nothing is outstanding. A failed send that no call has returned
  /// yet comes first; the answer then stays outstanding. `bytes` views the answer, of any length, until the next
  /// request.
  virtual IoResult receive(std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept = 0;
  /// Waits until the board has taken all that was sent; `no_answer` if it has not within `timeout_ns`.
  virtual IoResult flush(std::int64_t timeout_ns) noexcept = 0;
  /// Cancels all transfers and clears stalls, for a fresh start. May take seconds on a failing board; a cycle without
  /// errors never calls it.
  virtual void recover() noexcept = 0;
};

/// A board ready for use.
struct Board {
  std::unique_ptr<FrameLink> link{};
  std::unique_ptr<EmulatedTime> time{};  ///< only for an emulator in lock-step; uses the link and must end before it
  std::string place{};                   ///< for messages: ids, serial, bus address
  std::string serial{};                  ///< the board's own; without one, its bus address
  std::string address{};                 ///< its folder below driver.usb.sysfs_root
  explicit operator bool() const noexcept { return link != nullptr; }
};

// Bulk endpoints of the FPGA. 6 OUT and 8 IN are its JTAG: never touched.
inline constexpr std::uint8_t endpoint_out = 0x02;
inline constexpr std::uint8_t endpoint_in = 0x84;

}  // namespace abs_hil::driver::usb
