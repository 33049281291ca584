// The wire of the RT-DAC/USB2: its frames as one table of words, how the board is found in sysfs, and frames as USB
// request blocks through the kernel's usbfs.

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"

namespace abs_hil::driver::usb {

// Frames of the RT-DAC/USB2 with generic logic 1.03, from the maker's driver sources. They have not been tested on
// hardware.

inline constexpr std::size_t frame_bytes = 504;
inline constexpr std::size_t frame_words = frame_bytes / 2;  ///< 16 bits each, low byte first

/// A frame has 504 bytes in both directions.
using Frame = std::array<std::uint8_t, frame_bytes>;

/// Request for one frame.
inline constexpr std::array<std::uint8_t, 4> frame_request{0xFF, 0x8F, 0x00, 0x00};
/// First word of a frame to the board: bytes 0F 8F. Only this mark has bit 15 set: payload has 15 bits per word.
inline constexpr std::uint16_t write_mark = 0x8F0F;
inline constexpr std::uint16_t payload_bits = 0x7FFF;

/// Offsets in a frame, in words.
namespace word {
inline constexpr std::size_t version = 0;
inline constexpr std::size_t application = 1;
inline constexpr std::size_t date = 4;
inline constexpr std::size_t channel_counts = 6;
inline constexpr std::size_t digital_mode = 10;
inline constexpr std::size_t digital_direction = 12;
inline constexpr std::size_t digital_out = 14;
inline constexpr std::size_t digital_in = 16;
inline constexpr std::size_t pwm = 20;
inline constexpr std::size_t encoder_reset = 50;
inline constexpr std::size_t encoder_index_active = 51;
inline constexpr std::size_t encoder_index_invert = 52;
inline constexpr std::size_t encoder_counter = 53;
inline constexpr std::size_t timers = 70;
inline constexpr std::size_t adc_gain = 200;
inline constexpr std::size_t adc = 204;
inline constexpr std::size_t dac = 220;
}  // namespace word

inline constexpr std::size_t pwm_channels = 10;
inline constexpr std::size_t pwm_words = 3;  ///< of each channel
inline constexpr std::size_t encoder_channels = 8;
inline constexpr std::size_t encoder_words = 2;  ///< of each channel
inline constexpr std::size_t identity_words = 9;

/// What this driver does with a group of words.
enum class Use : std::uint8_t {
  never,     ///< not used; sent as 0
  kept,      ///< sent back with the value that the board had at `configure`
  checked,   ///< must keep the value that it had at `configure`; sent as 0 except for the mark
  received,  ///< read in every cycle
  sent       ///< written in every cycle
};
[[nodiscard]] std::string_view name_of(Use use) noexcept;

struct WordGroup {
  std::size_t first;
  std::size_t count;
  std::string_view name;
  std::string_view meaning;
  Standing standing;  ///< how well place and meaning are known
  Use use;
  std::string_view open{};  ///< open questions about it, if any
};
/// All words of a frame, in order, without gaps.
[[nodiscard]] std::span<const WordGroup> words() noexcept;

/// A word of a frame; 0 past its end.
[[nodiscard]] constexpr std::uint16_t word_at(std::span<const std::uint8_t> frame, std::size_t index) noexcept {
  if (2 * index + 1 >= frame.size()) return 0;
  return static_cast<std::uint16_t>(frame[2 * index] | frame[2 * index + 1] << 8U);
}
/// Puts payload into a frame to the board, without bit 15: the board would take it as a mark.
constexpr void put_payload(Frame& frame, std::size_t index, std::uint32_t value) noexcept {
  frame[2 * index] = static_cast<std::uint8_t>(value & 0xFFU);
  frame[2 * index + 1] = static_cast<std::uint8_t>((value & payload_bits) >> 8U);
}

/// The three words of one PWM channel.
using PwmWords = std::array<std::uint16_t, pwm_words>;
/// @param prescaler 0 ... 65535; its bit 15 is in the word of the mode
/// @param width 0 ... 4095
[[nodiscard]] constexpr PwmWords pwm_words_for(std::uint32_t mode, std::uint32_t prescaler,
                                               std::uint32_t width) noexcept {
  return {static_cast<std::uint16_t>(prescaler & payload_bits),
          static_cast<std::uint16_t>((mode << 1U | (prescaler >> 15U & 1U)) & payload_bits),
          static_cast<std::uint16_t>(width & 0xFFFU)};
}

/// The contents of a frame from the board that this driver uses.
struct Contents {
  std::array<std::uint16_t, identity_words> identity{};  ///< version, application, date, channel counts
  std::uint32_t upper_raw{0};                            ///< raw counter of the upper wheel's channel
  std::uint32_t lower_raw{0};
  PwmWords drive{};
  PwmWords brake{};
  std::uint16_t digital_out{0};  ///< lines 0 ... 15
  std::int64_t read_ns{0};       ///< when the counters were read; not of the frame
};
/// Parses a frame. For any length other than 504 it returns `incomplete_answer` and leaves `contents` unchanged.
/// Real-time safe.
[[nodiscard]] IoError decode(std::span<const std::uint8_t> bytes, const UsbOptions& options,
                             Contents& contents) noexcept;

/// Initial frame to the board: the mark, and every kept word with the board's value.
/// @param shown a frame from the board
[[nodiscard]] Frame frame_from(std::span<const std::uint8_t, frame_bytes> shown) noexcept;

/// The words of a frame that hold the outputs of drive, brake and enable line.
struct OutputWords {
  PwmWords drive{};
  PwmWords brake{};
  std::uint16_t digital{0};  ///< all output lines; 0 without an enable line
};

/// Puts widths and enable line into a frame to the board, and returns these words. Real-time safe.
OutputWords put_outputs(Frame& frame, const UsbOptions& options, std::uint32_t drive_width, std::uint32_t brake_width,
                        bool enable) noexcept;

/// True if a frame from the board shows these words.
[[nodiscard]] bool shows(const Contents& contents, const OutputWords& words, const UsbOptions& options) noexcept;

/// A device as the kernel shows it below /sys/bus/usb/devices, readable by every user.
struct UsbDevice {
  std::string address{};  ///< "1-1.4": bus and ports
  std::uint32_t vendor_id{0};
  std::uint32_t product_id{0};
  std::string manufacturer{};
  std::string product{};
  std::string serial{};
  std::uint32_t configuration{0};  ///< the active one; 0: none
  std::filesystem::path node{};    ///< the device's file, for usbfs
  /// "04b4:1003 serial 123 at 1-1.4", for messages.
  [[nodiscard]] std::string text() const;
};

/// The devices that match the ids, manufacturer and serial of the options, sorted by address; empty without USB.
/// Without ids and manufacturer in the options no device matches, because otherwise every device would.
[[nodiscard]] std::vector<UsbDevice> find_boards(const UsbOptions& options);

/// The board that the options select. Throws Unavailable with a fix if there is none, or more than one.
/// @param lock_step  advance the emulator's clock; refused without such a clock, as on all hardware. If false, an
///                   emulator in lock-step is refused
/// @param emulated  the board must be an emulator; any other board is refused
[[nodiscard]] UsbDevice choose_board(const UsbOptions& options, bool lock_step, bool emulated);

/// An emulator's product string contains `emulator_mark`; in lock-step it ends with `lock_step_mark`. No hardware has
/// these.
inline constexpr const char* emulator_mark = "emulator";
inline constexpr const char* lock_step_mark = "emulator in lock-step";

[[nodiscard]] bool carries_mark(const UsbDevice& device);
/// BackendRow::reality.
[[nodiscard]] BoardReality usb_reality(const UsbOptions& options);

/// Line for /etc/udev/rules.d that gives the group abs_hil access to the device.
[[nodiscard]] std::string udev_rule(const UsbDevice& device);

/// An interface, and the alternate setting of it.
struct InterfaceSetting {
  std::uint8_t number{0};
  std::uint8_t alternate{0};
};

/// Finds the first interface and alternate setting with both bulk endpoints of the FPGA.
/// @param descriptors   what a device node reads: the device's descriptor, then those of its configurations. Any bytes
///                      are allowed; what is cut short counts as missing
/// @param configuration the active one (bConfigurationValue)
[[nodiscard]] std::optional<InterfaceSetting> find_interface(std::span<const std::uint8_t> descriptors,
                                                             std::uint32_t configuration) noexcept;

/// Frames to and from one board without waiting: a call queues a transfer, and a later call returns its result.
/// Transfers reach the board in the order of queueing. An answer therefore includes the effect of all frames sent
/// before its request. As real-time safe as the system below it.
class FrameLink {
 public:
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

/// Frames as USB request blocks (URBs), which ioctls on the device's node give to the kernel and take back. All
/// URBs and buffers are allocated here. The functions of the link allocate nothing and take no lock in this
/// process. Its system calls are one ioctl per submission and two at most per completion, and the wait of `receive`
/// (docs/usb.md).
///
/// Opens the device and claims the interface with the FPGA's two endpoints. Throws Unavailable if access is not
/// permitted (with the udev rule that fixes it), if the device is in use, or if it lacks these endpoints. The end of
/// the link gives everything back to the kernel, which cancels what is under way.
/// @param usbfs must outlive the link
[[nodiscard]] std::unique_ptr<FrameLink> urb_link(const UsbDevice& device, Usbfs& usbfs = kernel_usbfs());

/// Opens the board that the options select (`choose_board`). Throws Unavailable.
/// @param usbfs must outlive the board
[[nodiscard]] Board open_board(const UsbOptions& options, bool lock_step, bool emulated, Usbfs& usbfs = kernel_usbfs());

}  // namespace abs_hil::driver::usb
