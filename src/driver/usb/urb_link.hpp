#pragma once

#include <linux/usbdevice_fs.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "driver/usb/discovery.hpp"
#include "driver/usb/frame_link.hpp"
#include "driver/usb/usbfs.hpp"

namespace abs_hil::driver::usb {

/// Frames as USB request blocks (URBs), which ioctls on the device's node give to the kernel and take back. The
/// constructor allocates all URBs and buffers. Every other function allocates nothing and takes no lock in this
/// process. Its system calls are one ioctl per submission and two at most per completion, and the wait of `receive`
/// (docs/usb.md).
class UrbLink final : public FrameLink {
 public:
  /// Opens the device and claims the interface with the FPGA's two endpoints. Throws Unavailable if access is not
  /// permitted (with the udev rule that fixes it), if the device is in use, or if it lacks these endpoints.
  /// @param usbfs must outlive the link
  explicit UrbLink(const UsbDevice& device, Usbfs& usbfs = kernel_usbfs());
  /// Gives everything back to the kernel, which cancels what is under way.
  ~UrbLink() override = default;

  IoResult send(const Frame& frame) noexcept override;
  IoResult request() noexcept override;
  [[nodiscard]] bool answer_outstanding() const noexcept override;
  IoResult receive(std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept override;
  IoResult flush(std::int64_t timeout_ns) noexcept override;
  void recover() noexcept override;

  /// Control requests of the emulator in lock-step, never sent to hardware.
  IoResult emulated_time(std::int64_t& time_ns) noexcept;
  IoResult advance_emulated_time(std::int64_t time_ns) noexcept;

 private:
  /// The open node; closes itself.
  class Node {
   public:
    Node(const UsbDevice& device, Usbfs& usbfs);
    Node(const Node&) = delete;
    Node& operator=(const Node&) = delete;
    ~Node() { usbfs_.close(file_); }
    int ioctl(unsigned long request, void* argument) noexcept { return usbfs_.ioctl(file_, request, argument); }
    [[nodiscard]] std::vector<std::uint8_t> descriptors(const UsbDevice& device);
    void wait(std::int64_t timeout_ns) noexcept { usbfs_.wait(file_, timeout_ns); }
    std::int64_t now_ns() noexcept { return usbfs_.now_ns(); }

   private:
    Usbfs& usbfs_;
    int file_;
  };
  /// The size of a full packet, so that an answer that is too long is not reported as an overflow.
  static constexpr std::size_t packet_bytes = 512;
  /// One URB and its buffer. While it is under way the kernel owns both.
  struct Slot {
    std::unique_ptr<usbdevfs_urb> urb{};
    std::array<std::uint8_t, packet_bytes> buffer{};
    bool under_way{false};
    int status{0};  ///< of the last transfer: 0, or -errno until a call has returned it
    std::size_t length{0};
  };
  static constexpr std::size_t frame_slots = 3;

  void claim(const UsbDevice& device);
  IoResult submit(Slot& slot, std::size_t bytes) noexcept;
  /// Takes back from the kernel what has ended.
  void reap() noexcept;
  /// Reaps until the slot is free or the time has passed.
  void wait_for(const Slot& slot, std::int64_t deadline_ns) noexcept;
  /// The first failed send that no call has returned yet.
  IoResult take_send_failure() noexcept;
  void cancel(Slot& slot) noexcept;
  void cancel_all() noexcept;
  IoResult control(std::uint8_t direction, std::int64_t& time_ns) noexcept;

  std::array<Slot, frame_slots> frames_{};
  std::size_t next_frame_{0};
  Slot request_{};
  Slot answer_{};
  std::array<Slot*, frame_slots + 2> all_{&frames_[0], &frames_[1], &frames_[2], &request_, &answer_};
  Node node_;  ///< last, so that the kernel gives the URBs up before they are freed
};

/// Opens the board that the options select (`choose_board`). Throws Unavailable.
/// @param usbfs must outlive the board
[[nodiscard]] Board open_board(const UsbOptions& options, bool lock_step, bool emulated, Usbfs& usbfs = kernel_usbfs());

}  // namespace abs_hil::driver::usb
