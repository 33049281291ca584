#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "emulator/usb_board_model.hpp"

namespace abs_hil::emulator {

/// Identity of the board. The ids are from pid.codes' range for tests, because the maker's are not public.
struct UsbIdentity {
  std::uint16_t vendor_id{0x1209};
  std::uint16_t product_id{0x0001};
  std::string manufacturer{"InTeCo"};
  std::string product{"RT-DAC/USB2 emulator"};  ///< in lock-step "... in lock-step"
  std::string serial{"1"};
};

/// A USB device for the Linux kernel's virtual host controller (vhci_hcd). Commands of the USB/IP protocol
/// (Documentation/usb/usbip_protocol.rst) come as a stream of bytes, and replies go back. The device has high speed and
/// one interface. It has bulk endpoints 2 OUT and 4 IN for frames, and 6 OUT and 8 IN, the JTAG of the real board,
/// which a driver must not use. Descriptors: USB 2.0, chapter 9.
class UsbipDevice {
 public:
  using GoOnTo = std::function<void(std::int64_t time_ns)>;
  /// @param lock_step called when the host advances the rig's time; empty: the caller advances it
  UsbipDevice(UsbBoardModel& board, const UsbIdentity& identity, std::uint64_t seed, GoOnTo lock_step = {});

  /// Takes bytes from the host, complete commands or parts of them, and appends the replies.
  /// @param now_ns time on any monotonic clock, for late answers
  /// Throws std::runtime_error if the bytes are not a command of the protocol: the stream is lost.
  void receive(std::span<const std::uint8_t> bytes, std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  /// Appends the answers that are due.
  void give_answers(std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  /// Resets the state of the connection, like a board that is plugged in again. The outputs do not change.
  void reconnect();
  /// True if the host has configured the device.
  [[nodiscard]] bool configured() const noexcept { return configured_; }

  UsbFaults faults{};
  [[nodiscard]] std::uint64_t jtag_transfers() const noexcept { return jtag_transfers_; }

 private:
  /// A command to submit a transfer (USBIP_CMD_SUBMIT).
  struct Transfer {
    std::uint32_t sequence{0};
    bool in{false};
    std::uint32_t endpoint{0};
    std::uint32_t length{0};
    std::array<std::uint8_t, 8> setup{};
    std::span<const std::uint8_t> data{};
  };
  struct Waiting {
    std::uint32_t sequence{0};
    std::uint32_t length{0};
  };
  struct Answer {
    std::vector<std::uint8_t> bytes{};
    std::int64_t due_ns{0};
  };

  void submit(const Transfer& transfer, std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  void unlink(std::uint32_t sequence, std::uint32_t unlinked, std::vector<std::uint8_t>& replies);
  void control(const Transfer& transfer, std::vector<std::uint8_t>& replies);
  void bulk_out(const Transfer& transfer, std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  [[nodiscard]] std::vector<std::uint8_t> descriptor(std::uint8_t type, std::uint8_t index) const;

  UsbBoardModel& board_;
  UsbIdentity identity_;
  GoOnTo lock_step_;
  std::mt19937_64 random_;
  std::vector<std::uint8_t> received_{};
  std::deque<Waiting> waiting_{};  ///< the host's reads without an answer
  std::deque<Answer> answers_{};   ///< answers that the host has not read yet
  std::uint64_t jtag_transfers_{0};
  bool configured_{false};
};

}  // namespace abs_hil::emulator
