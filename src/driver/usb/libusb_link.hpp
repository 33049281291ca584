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

/// Frames over libusb-1.0's asynchronous transfers. All transfers and buffers are made with the link; what libusb
/// itself does on the cycle's path (docs/usb.md): it takes its own uncontended locks, allocates one small block for
/// each transfer submitted and gives it back when that is over, and makes an ioctl for each submission, a poll and an
/// ioctl for each completion.
class LibusbLink final : public FrameLink {
 public:
  /// Opens the device, claims the interface with the FPGA's two endpoints. Throws Unavailable: not permitted (with the
  /// udev rule that mends it), in use, or without these endpoints.
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
  /// A full packet, so that an answer that is too long shows as that and not as an overflow.
  static constexpr std::size_t packet_bytes = 512;
  struct Slot {
    libusb_transfer* transfer{nullptr};
    std::array<std::uint8_t, packet_bytes> buffer{};
    int done{1};  ///< not under way; an int because libusb waits on one
    int status{0};
    int length{0};
  };
  static constexpr std::size_t frame_slots = 3;

  static void on_done(libusb_transfer* transfer);
  void claim(const UsbDevice& device);
  IoResult submit(Slot& slot, std::size_t bytes) noexcept;
  /// Handles events until the slot is done or the time is over.
  void wait_for(Slot& slot, std::int64_t timeout_ns) noexcept;
  void handle_events(std::int64_t timeout_ns, int* completed) noexcept;
  /// The first failure of what was sent and has not been told yet.
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

/// The board that the options mean, ready for use; `choose_board` says which. Throws Unavailable.
[[nodiscard]] Board open_board(const UsbOptions& options, bool lock_step, bool emulated);

}  // namespace abs_hil::driver::usb
