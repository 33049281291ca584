// Queues and reaps USB request blocks without waiting.
#include <fcntl.h>
#include <linux/ioctl.h>
#include <linux/usb/ch9.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <optional>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/usb/wire.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::usb {

namespace {

class KernelUsbfs final : public Usbfs {
 public:
  int open(const char* node) noexcept override {
    const int file = ::open(node, O_RDWR | O_CLOEXEC);
    return file >= 0 ? file : -errno;
  }
  void close(int file) noexcept override { ::close(file); }
  std::int64_t read(int file, std::span<std::uint8_t> bytes) noexcept override {
    const ssize_t got = ::read(file, bytes.data(), bytes.size());
    return got >= 0 ? got : -errno;
  }
  int ioctl(int file, unsigned long request, void* argument) noexcept override {
    const int result = ::ioctl(file, request, argument);
    return result >= 0 ? result : -errno;
  }
  void wait(int file, std::int64_t timeout_ns) noexcept override {
    pollfd waiting{file, POLLOUT, 0};  // usbfs: writable means that a transfer has ended
    const timespec limit{static_cast<time_t>(timeout_ns / rig::ns_per_s),
                         static_cast<long>(timeout_ns % rig::ns_per_s)};
    static_cast<void>(::ppoll(&waiting, 1, &limit, nullptr));
  }
  std::int64_t now_ns() noexcept override { return monotonic_ns(); }
};

}  // namespace

Usbfs& kernel_usbfs() noexcept {
  static KernelUsbfs kernel;
  return kernel;
}

namespace {

/// The kernel cancels synchronously: this passes only if it fails to.
constexpr std::int64_t give_up_ns = rig::ns_per_s;

[[noreturn]] void refuse_device(const UsbDevice& device, const std::string& what) {
  refuse("USB board " + device.text() + ": " + what);
}

/// Refuses the device if `result` is -errno.
void require(const UsbDevice& device, std::int64_t result, const std::string& what) {
  if (result < 0)
    refuse_device(device, what + ": " + rig::refusal(static_cast<int>(-result), device.node, rig::reaching));
}

/// @param result 0 or more, or -errno of a system call
IoResult from_result(int result, std::uint32_t endpoint) noexcept {
  if (result >= 0) return {};
  switch (-result) {
    case ENODEV:
    case ESHUTDOWN: return {IoError::disconnected, endpoint, ENODEV};
    case EPIPE: return {IoError::stalled, endpoint, EPIPE};
    case EOVERFLOW: return {IoError::incomplete_answer, endpoint, EOVERFLOW};
    case ETIMEDOUT:
    case EBUSY: return {IoError::no_answer, endpoint};
    default: return {IoError::transfer_failed, endpoint, -result};
  }
}

/// @param status of a transfer that has ended: 0, or -errno
IoResult from_status(int status, std::uint32_t endpoint) noexcept {
  const bool cancelled = status == -ENOENT || status == -ECONNRESET;
  return cancelled ? IoResult{IoError::no_answer, endpoint} : from_result(status, endpoint);
}

// Control requests that only the emulator has.
constexpr std::uint8_t request_emulated_time = 0x54;
constexpr std::uint32_t control_timeout_ms = 10'000;

/// The open node; closes itself.
class Node {
 public:
  Node(const UsbDevice& device, Usbfs& usbfs) : usbfs_(usbfs), file_(usbfs.open(device.node.c_str())) {
    if (file_ >= 0) return;
    std::string what = device.node.string() + ": ";
    if (file_ != -EACCES && file_ != -EPERM) {
      what += rig::refusal(-file_, device.node, rig::reaching);
    } else {
      what += std::string(std::strerror(-file_)) +
              ". Put this line into /etc/udev/rules.d/70-abs-hil.rules and plug the board in again (docs/usb.md):\n" +
              udev_rule(device);
    }
    refuse_device(device, what);
  }
  Node(Node&&) = delete;  // nor copied
  ~Node() { usbfs_.close(file_); }
  int ioctl(unsigned long request, void* argument) noexcept { return usbfs_.ioctl(file_, request, argument); }
  std::vector<std::uint8_t> descriptors(const UsbDevice& device) {
    constexpr std::size_t part_bytes = 4096;
    constexpr std::size_t most_bytes = 1U << 20U;  // a file of another kind may never end
    std::vector<std::uint8_t> bytes;
    std::array<std::uint8_t, part_bytes> part{};
    while (bytes.size() < most_bytes) {
      const std::int64_t got = usbfs_.read(file_, part);
      require(device, got, "its descriptors cannot be read");
      if (got == 0) break;
      bytes.insert(bytes.end(), part.begin(), part.begin() + got);
    }
    return bytes;
  }
  void wait(std::int64_t timeout_ns) noexcept { usbfs_.wait(file_, timeout_ns); }
  std::int64_t now_ns() noexcept { return usbfs_.now_ns(); }

 private:
  Usbfs& usbfs_;
  int file_;
};
class UrbLink final : public FrameLink {
 public:
  explicit UrbLink(const UsbDevice& device, Usbfs& usbfs) : node_(device, usbfs) {
    claim(device);
    for (Slot* slot : all_) {
      slot->urb = std::make_unique<usbdevfs_urb>();
      slot->urb->type = USBDEVFS_URB_TYPE_BULK;
      slot->urb->endpoint = slot == &answer_ ? endpoint_in : endpoint_out;
      slot->urb->buffer = slot->buffer.data();
    }
    std::copy(frame_request.begin(), frame_request.end(), request_.buffer.begin());
  }
  IoResult send(const Frame& frame) noexcept override {
    reap();
    if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
    Slot& slot = frames_[next_frame_];
    if (slot.under_way) return {IoError::no_answer, endpoint_out};
    std::copy(frame.begin(), frame.end(), slot.buffer.begin());
    const IoResult result = submit(slot, frame.size());
    if (result.ok()) next_frame_ = (next_frame_ + 1) % frames_.size();
    return result;
  }
  IoResult request() noexcept override {
    if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
    if (request_.under_way || answer_.under_way) return {IoError::no_answer, endpoint_out};
    // Submit the receiving transfer first, so that the answer is not lost.
    if (const IoResult result = submit(answer_, answer_.buffer.size()); !result.ok()) return result;
    return submit(request_, frame_request.size());
  }
  [[nodiscard]] bool answer_outstanding() const noexcept override { return answer_.under_way; }
  IoResult receive(std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept override {
    const std::int64_t deadline_ns = node_.now_ns() + timeout_ns;
    while (answer_.under_way) {
      reap();
      if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
      if (!answer_.under_way) break;
      const std::int64_t left_ns = deadline_ns - node_.now_ns();
      if (left_ns <= 0) return {IoError::no_answer, endpoint_in};
      node_.wait(left_ns);
    }
    if (const IoResult result = from_status(answer_.status, endpoint_in); !result.ok()) return result;
    bytes = std::span(answer_.buffer).first(answer_.length);
    return {};
  }
  IoResult flush(std::int64_t timeout_ns) noexcept override {
    const std::int64_t deadline_ns = node_.now_ns() + timeout_ns;
    for (const Slot& slot : frames_) wait_for(slot, deadline_ns);
    if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
    const bool taken = std::none_of(frames_.begin(), frames_.end(), [](const Slot& slot) { return slot.under_way; });
    return taken ? IoResult{} : IoResult{IoError::no_answer, endpoint_out};
  }
  void recover() noexcept override {
    cancel_all();
    for (unsigned endpoint : {endpoint_out, endpoint_in}) {
      static_cast<void>(node_.ioctl(USBDEVFS_CLEAR_HALT, &endpoint));
    }
    // The board may still hold the cancelled answer. Discard it, so that it does not count as the next one.
    constexpr int most_answers = 4;
    constexpr std::int64_t quiet_ns = 20'000'000;
    for (int i = 0; i < most_answers && !answer_.under_way; ++i) {
      if (!submit(answer_, answer_.buffer.size()).ok()) return;
      wait_for(answer_, node_.now_ns() + quiet_ns);
    }
    cancel_all();
  }

  [[nodiscard]] Node& node() noexcept { return node_; }

 private:
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

  void claim(const UsbDevice& device) {
    if (device.configuration == 0) {
      refuse_device(device, "has no configuration: the kernel has not accepted it (see dmesg); plug it in again");
    }
    const std::optional<InterfaceSetting> found = find_interface(node_.descriptors(device), device.configuration);
    if (!found) {
      refuse_device(device,
                    "has no interface with bulk endpoints 02 (out) and 84 (in): it is another device, or its firmware "
                    "is missing");
    }
    unsigned interface = found->number;
    const int claimed = node_.ioctl(USBDEVFS_CLAIMINTERFACE, &interface);
    if (claimed == -EBUSY) {
      refuse_device(device, "is in use by another process; a board has only one owner: end that process first");
    }
    require(device, claimed, "cannot be claimed");
    if (found->alternate == 0) return;
    usbdevfs_setinterface setting{.interface = found->number, .altsetting = found->alternate};
    require(device, node_.ioctl(USBDEVFS_SETINTERFACE, &setting), "does not accept its alternate setting");
  }
  IoResult submit(Slot& slot, std::size_t bytes) noexcept {
    slot.urb->buffer_length = static_cast<int>(bytes);
    slot.status = 0;
    slot.length = 0;
    const int result = node_.ioctl(USBDEVFS_SUBMITURB, slot.urb.get());
    slot.under_way = result >= 0;
    return from_result(result, slot.urb->endpoint);
  }
  /// Takes back from the kernel what has ended.
  void reap() noexcept {
    const auto is_under_way = [](const Slot* slot) { return slot->under_way; };
    while (std::any_of(all_.begin(), all_.end(), is_under_way)) {
      usbdevfs_urb* ended = nullptr;
      const int result = node_.ioctl(USBDEVFS_REAPURBNDELAY, &ended);
      if (result == -EAGAIN) return;
      for (Slot* slot : all_) {
        if (!slot->under_way || (result >= 0 && slot->urb.get() != ended)) continue;
        slot->under_way = false;
        slot->status = result < 0 ? result : ended->status;  // a node that fails has lost all its transfers
        slot->length = result < 0 ? 0 : static_cast<std::size_t>(ended->actual_length);
      }
    }
  }
  /// Reaps until the slot is free or the time has passed.
  void wait_for(const Slot& slot, std::int64_t deadline_ns) noexcept {
    for (;;) {
      reap();
      if (!slot.under_way) return;
      const std::int64_t left_ns = deadline_ns - node_.now_ns();
      if (left_ns <= 0) return;
      node_.wait(left_ns);
    }
  }
  /// The first failed send that no call has returned yet.
  IoResult take_send_failure() noexcept {
    for (Slot* slot : all_) {
      if (slot == &answer_ || slot->under_way || slot->status == 0) continue;
      const IoResult result = from_status(slot->status, endpoint_out);
      slot->status = 0;
      return result;
    }
    return {};
  }
  void cancel(Slot& slot) noexcept {
    // Fails if the transfer has ended meanwhile; it is reaped in either case.
    if (slot.under_way) static_cast<void>(node_.ioctl(USBDEVFS_DISCARDURB, slot.urb.get()));
  }
  void cancel_all() noexcept {
    for (Slot* slot : all_) cancel(*slot);
    const std::int64_t deadline_ns = node_.now_ns() + give_up_ns;
    for (Slot* slot : all_) {
      wait_for(*slot, deadline_ns);
      slot->status = 0;
    }
  }

  std::array<Slot, frame_slots> frames_{};
  std::size_t next_frame_{0};
  Slot request_{};
  Slot answer_{};
  std::array<Slot*, frame_slots + 2> all_{&frames_[0], &frames_[1], &frames_[2], &request_, &answer_};
  Node node_;  ///< last, so that the kernel gives the URBs up before they are freed
};

/// Control requests of the emulator in lock-step, never sent to hardware.
class LinkTime final : public EmulatedTime {
 public:
  explicit LinkTime(Node& node) : node_(node) {}
  IoResult now(std::int64_t& time_ns) noexcept override {
    std::int64_t shown_ns = 0;
    const IoResult result = control(USB_DIR_IN, shown_ns);
    if (result.ok()) time_ns = shown_ns;
    return result;
  }
  IoResult advance_to(std::int64_t time_ns) noexcept override { return control(USB_DIR_OUT, time_ns); }

 private:
  IoResult control(std::uint8_t direction, std::int64_t& time_ns) noexcept {
    usbdevfs_ctrltransfer transfer{.bRequestType = static_cast<__u8>(direction | USB_TYPE_VENDOR),
                                   .bRequest = request_emulated_time,
                                   .wValue = 0,
                                   .wIndex = 0,
                                   .wLength = sizeof time_ns,
                                   .timeout = control_timeout_ms,
                                   .data = &time_ns};
    const int bytes = node_.ioctl(USBDEVFS_CONTROL, &transfer);
    return from_result(bytes < 0 || bytes == int{sizeof time_ns} ? bytes : -EIO, 0);
  }

  Node& node_;
};

}  // namespace

std::unique_ptr<FrameLink> urb_link(const UsbDevice& device, Usbfs& usbfs) {
  return std::make_unique<UrbLink>(device, usbfs);
}

Board open_board(const UsbOptions& options, bool lock_step, bool emulated, Usbfs& usbfs) {
  const UsbDevice device = choose_board(options, lock_step, emulated);
  auto link = std::make_unique<UrbLink>(device, usbfs);
  Board board{.place = device.text(),
              .serial = device.serial.empty() ? device.address : device.serial,
              .address = device.address};
  if (lock_step) board.time = std::make_unique<LinkTime>(link->node());
  board.link = std::move(link);
  return board;
}

}  // namespace abs_hil::driver::usb
