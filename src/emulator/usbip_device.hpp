#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "emulator/usb_board_model.hpp"
#include "emulator/usb_faults.hpp"

namespace abs_hil::emulator {

/// How the board introduces itself. Ids are of pid.codes' range for tests: the maker's are not public.
struct UsbIdentity {
  std::uint16_t vendor_id{0x1209};
  std::uint16_t product_id{0x0001};
  std::string manufacturer{"InTeCo"};
  std::string product{"RT-DAC/USB2 emulator"};  ///< in lock-step "... in lock-step"
  std::string serial{"1"};
};

/// A USB device as the Linux kernel's virtual host controller (vhci_hcd) speaks to it: commands of the USB/IP protocol
/// (Documentation/usb/usbip_protocol.rst) come as a stream of bytes, replies go back. High speed, one interface, bulk
/// endpoints 2 OUT and 4 IN for frames, and 6 OUT and 8 IN, the JTAG of the real board, which must stay untouched.
/// Descriptors: USB 2.0, chapter 9.
class UsbipDevice {
 public:
  using GoOnTo = std::function<void(std::int64_t time_ns)>;
  /// @param lock_step called when the host drives the rig's time; empty: time is the caller's
  UsbipDevice(UsbBoardModel& board, const UsbIdentity& identity, std::uint64_t seed, GoOnTo lock_step = {});

  /// Takes what came from the host, whole commands or parts of them; appends what is to be sent to it.
  /// @param now_ns any clock that never goes back: late answers are measured with it
  /// Throws std::runtime_error for what is no command of the protocol: the stream is lost.
  void receive(std::span<const std::uint8_t> bytes, std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  /// Answers that were late and are due now.
  void answer_late_ones(std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  /// Forgets the connection's state, as a board does that is plugged in anew. Its outputs stay.
  void reconnect();
  /// The host has taken it into use.
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
  void give_answers(std::int64_t now_ns, std::vector<std::uint8_t>& replies);
  [[nodiscard]] std::vector<std::uint8_t> descriptor(std::uint8_t type, std::uint8_t index) const;

  UsbBoardModel& board_;
  UsbIdentity identity_;
  GoOnTo lock_step_;
  std::mt19937_64 random_;
  std::vector<std::uint8_t> received_{};
  std::deque<Waiting> waiting_{};  ///< reads of the host that have no answer yet
  std::deque<Answer> answers_{};   ///< answers that nobody has read yet
  std::uint64_t jtag_transfers_{0};
  bool configured_{false};
};

}  // namespace abs_hil::emulator
