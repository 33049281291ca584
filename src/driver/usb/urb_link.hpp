// The wire of the RT-DAC/USB2: frames as USB request blocks, through the kernel's usbfs.

#pragma once

#include <linux/usbdevice_fs.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/usb/discovery.hpp"
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

/// Asks for a frame and waits for it, at most `timeout_ns` for each answer. An answer that was asked for before shows
/// the outputs of that moment, so it is dropped.
inline IoResult fresh_answer(FrameLink& link, std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept {
  IoResult result = link.answer_outstanding() ? link.receive(timeout_ns, bytes) : IoResult{};
  if (result.ok()) result = link.request();
  return result.ok() ? link.receive(timeout_ns, bytes) : result;
}

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

/// The system calls on a USB device's node (the kernel's usbfs), so that tests can take the kernel's place. A negative
/// result is -errno. As real-time safe as the kernel below it.
class Usbfs {
 public:
  Usbfs() = default;
  Usbfs(const Usbfs&) = delete;
  Usbfs& operator=(const Usbfs&) = delete;
  virtual ~Usbfs() = default;

  /// Opens the node for reading and writing; returns its file descriptor.
  virtual int open(const char* node) noexcept = 0;
  /// Closes the node: the kernel cancels its transfers and releases its interfaces.
  virtual void close(int file) noexcept = 0;
  /// Reads the device's descriptors, from where the last call ended; returns the number of bytes, 0 at the end.
  virtual std::int64_t read(int file, std::span<std::uint8_t> bytes) noexcept = 0;
  /// @param request one of the USBDEVFS_... of linux/usbdevice_fs.h
  virtual int ioctl(int file, unsigned long request, void* argument) noexcept = 0;
  /// Waits until a transfer has ended or the device is gone, at most `timeout_ns` > 0. May return earlier.
  virtual void wait(int file, std::int64_t timeout_ns) noexcept = 0;
  /// Monotonic clock.
  virtual std::int64_t now_ns() noexcept = 0;
};

/// The kernel itself. Its calls allocate nothing and take no lock in this process.
[[nodiscard]] Usbfs& kernel_usbfs() noexcept;

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
