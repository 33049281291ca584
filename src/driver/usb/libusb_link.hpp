#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "driver/file_descriptor.hpp"
#include "driver/usb/discovery.hpp"
#include "driver/usb/frame_link.hpp"

struct libusb_context;
struct libusb_device_handle;
struct libusb_transfer;

namespace abs_hil::driver::usb {

/// Frames over libusb-1.0's asynchronous transfers. The constructor allocates all transfers and buffers. On the cycle's
/// path libusb itself takes its own uncontended locks, allocates and frees one small block per transfer, and makes one
/// ioctl per submission and one poll and one ioctl per completion (docs/usb.md).
class LibusbLink final : public FrameLink {
 public:
  /// Opens the device and claims the interface with the FPGA's two endpoints. Throws Unavailable if access is not
  /// permitted (with the udev rule that fixes it), if the device is in use, or if it lacks these endpoints.
  explicit LibusbLink(const UsbDevice& device);
  ~LibusbLink() override;

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
  /// The size of a full packet, so that an answer that is too long is not reported as an overflow.
  static constexpr std::size_t packet_bytes = 512;
  struct Slot {
    libusb_transfer* transfer{nullptr};
    std::array<std::uint8_t, packet_bytes> buffer{};
    int done{1};  ///< 1: no transfer is under way; an int because libusb requires one
    int status{0};
    int length{0};
  };
  static constexpr std::size_t frame_slots = 3;

  static void on_done(libusb_transfer* transfer);
  void claim(const UsbDevice& device);
  IoResult submit(Slot& slot, std::size_t bytes) noexcept;
  /// Handles events until the slot is done or the time has passed.
  void wait_for(Slot& slot, std::int64_t timeout_ns) noexcept;
  void handle_events(std::int64_t timeout_ns, int* completed) noexcept;
  /// The first failed send that no call has returned yet.
  IoResult take_send_failure() noexcept;
  void cancel_all() noexcept;

  FileDescriptor node_;
  libusb_context* context_{nullptr};
  libusb_device_handle* handle_{nullptr};
  int interface_{-1};
  std::array<Slot, frame_slots> frames_{};
  std::size_t next_frame_{0};
  Slot request_{};
  Slot answer_{};
};

/// Opens the board that the options select (`choose_board`). Throws Unavailable.
[[nodiscard]] Board open_board(const UsbOptions& options, bool lock_step, bool emulated);

}  // namespace abs_hil::driver::usb
