// Speaks USB/IP with the kernel for the emulated USB board.

#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
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
  using Bytes = std::vector<std::uint8_t>;
  using GoOnTo = std::function<void(std::int64_t time_ns)>;
  /// @param lock_step called when the host advances the rig's time; empty: the caller advances it
  UsbipDevice(UsbBoardModel& board, const UsbIdentity& identity, std::uint64_t seed, GoOnTo lock_step = {})
      : board_(board), identity_(identity), lock_step_(std::move(lock_step)), random_(seed) {
    if (lock_step_) identity_.product += " in lock-step";
    for (const std::string& text : {identity_.manufacturer, identity_.product, identity_.serial}) {
      constexpr std::size_t longest = 126;
      if (text.size() > longest) throw std::invalid_argument("\"" + text + "\": at most 126 characters");
    }
  }

  /// Takes bytes from the host, complete commands or parts of them, and appends the replies.
  /// @param now_ns time on any monotonic clock, for late answers
  /// Throws std::runtime_error if the bytes are not a command of the protocol: the stream is lost.
  void receive(std::span<const std::uint8_t> bytes, std::int64_t now_ns, Bytes& replies) {
    received_.insert(received_.end(), bytes.begin(), bytes.end());
    std::span<const std::uint8_t> rest(received_);
    while (rest.size() >= header_bytes) {
      const std::uint32_t command = big_endian(rest, 0);
      const std::uint32_t sequence = big_endian(rest, 4);
      if (command == cmd_unlink) {
        unlink(sequence, big_endian(rest, 20), replies);
        rest = rest.subspan(header_bytes);
        continue;
      }
      Transfer transfer{.sequence = sequence,
                        .in = big_endian(rest, 12) == 1,
                        .endpoint = big_endian(rest, 16),
                        .length = big_endian(rest, 24)};
      if (command != cmd_submit || transfer.length > most_bytes) {
        throw std::runtime_error("USB/IP: command " + std::to_string(command) + " with " +
                                 std::to_string(transfer.length) + " bytes is not part of the protocol");
      }
      const std::size_t whole = header_bytes + (transfer.in ? 0 : transfer.length);
      if (rest.size() < whole) break;
      std::memcpy(transfer.setup.data(), rest.data() + 40, transfer.setup.size());
      transfer.data = rest.subspan(header_bytes, whole - header_bytes);
      submit(transfer, now_ns, replies);
      rest = rest.subspan(whole);
    }
    received_.erase(received_.begin(), received_.end() - static_cast<std::ptrdiff_t>(rest.size()));
  }
  /// Appends the answers that are due.
  void give_answers(std::int64_t now_ns, Bytes& replies) {
    while (!waiting_.empty() && faults.stall_in != UsbFaults::Stall::none) {
      reply(replies, waiting_.front().sequence, status_stall, 0);
      waiting_.pop_front();
    }
    while (!waiting_.empty() && !answers_.empty() && answers_.front().due_ns <= now_ns) {
      const Waiting host = waiting_.front();
      const Answer answer = std::move(answers_.front());
      waiting_.pop_front();
      answers_.pop_front();
      const bool fits = answer.bytes.size() <= host.length;
      const auto bytes = std::span(answer.bytes).first(fits ? answer.bytes.size() : host.length);
      reply(replies, host.sequence, fits ? 0 : status_overflow, static_cast<std::uint32_t>(bytes.size()), bytes);
    }
  }
  /// Resets the state of the connection, like a board that is plugged in again. The outputs do not change.
  void reconnect() {
    received_.clear();
    waiting_.clear();
    answers_.clear();
    configured_ = false;
  }
  /// True if the host has configured the device.
  [[nodiscard]] bool configured() const noexcept { return configured_; }

  UsbFaults faults{};
  [[nodiscard]] std::uint64_t jtag_transfers() const noexcept { return jtag_transfers_; }

 private:
  static constexpr std::size_t header_bytes = 48;
  static constexpr std::uint32_t most_bytes = 1U << 20U;

  enum Command : std::uint32_t { cmd_submit = 1, cmd_unlink = 2, ret_submit = 3, ret_unlink = 4 };
  // Linux error numbers, which the protocol transmits.
  static constexpr std::int32_t status_stall = -32;      // EPIPE
  static constexpr std::int32_t status_overflow = -75;   // EOVERFLOW
  static constexpr std::int32_t status_unlinked = -104;  // ECONNRESET

  static constexpr std::uint8_t lock_step_request = 0x54;

  static std::uint32_t big_endian(std::span<const std::uint8_t> bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8U | bytes[at + i];
    return value;
  }

  /// Appends a message: its first words, high bytes first, then zeros up to the header's end, and the data of a read.
  static void append(Bytes& out, std::initializer_list<std::uint32_t> words, std::span<const std::uint8_t> data = {}) {
    std::array<std::uint32_t, header_bytes / 4> header{};
    std::ranges::copy(words, header.begin());
    for (const std::uint32_t word : header) {
      for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(word >> shift));
    }
    out.insert(out.end(), data.begin(), data.end());
  }
  /// @param data data of a read; empty for a write, for which `length` tells the number of bytes taken
  static void reply(Bytes& out, std::uint32_t sequence, std::int32_t status, std::uint32_t length,
                    std::span<const std::uint8_t> data = {}) {
    // Device, direction and endpoint are 0: the host knows them.
    append(out, {ret_submit, sequence, 0, 0, 0, static_cast<std::uint32_t>(status), length}, data);
  }

  static Bytes text_descriptor(const std::string& text) {
    Bytes bytes{static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
    for (const char c : text) {
      bytes.push_back(static_cast<std::uint8_t>(c));
      bytes.push_back(0);
    }
    return bytes;
  }

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
    Bytes bytes{};
    std::int64_t due_ns{0};
  };

  void submit(const Transfer& transfer, std::int64_t now_ns, Bytes& replies) {
    if (transfer.endpoint == 0) {
      control(transfer, replies);
    } else if (transfer.endpoint == 2 && !transfer.in) {
      bulk_out(transfer, now_ns, replies);
    } else if (transfer.endpoint == 4 && transfer.in) {
      waiting_.push_back({transfer.sequence, transfer.length});
      give_answers(now_ns, replies);
    } else {
      ++jtag_transfers_;
      reply(replies, transfer.sequence, status_stall, 0);
    }
  }
  void unlink(std::uint32_t sequence, std::uint32_t unlinked, Bytes& replies) {
    const auto found = std::ranges::find(waiting_, unlinked, &Waiting::sequence);
    const bool was_waiting = found != waiting_.end();
    if (was_waiting) waiting_.erase(found);
    append(replies, {ret_unlink, sequence, 0, 0, 0, static_cast<std::uint32_t>(was_waiting ? status_unlinked : 0)});
  }
  void control(const Transfer& t, Bytes& replies) {
    const std::uint8_t kind = t.setup[0];
    const std::uint8_t request = t.setup[1];
    const auto length = static_cast<std::size_t>(t.setup[6] | t.setup[7] << 8U);
    const auto give = [&](std::span<const std::uint8_t> data) {
      const auto part = data.first(std::min({data.size(), length, static_cast<std::size_t>(t.length)}));
      reply(replies, t.sequence, 0, static_cast<std::uint32_t>(part.size()), part);
    };
    const auto stall = [&] { reply(replies, t.sequence, status_stall, 0); };
    constexpr std::uint8_t get_status = 0;
    constexpr std::uint8_t clear_feature = 1;
    constexpr std::uint8_t get_descriptor = 6;
    constexpr std::uint8_t set_configuration = 9;
    if (kind == 0xC0 && request == lock_step_request && lock_step_) {
      std::array<std::uint8_t, 8> time{};
      const std::int64_t time_ns = board_.time_ns();
      std::memcpy(time.data(), &time_ns, time.size());
      give(time);
    } else if (kind == 0x40 && request == lock_step_request && lock_step_ && t.data.size() == sizeof(std::int64_t)) {
      std::int64_t time_ns = 0;
      std::memcpy(&time_ns, t.data.data(), sizeof time_ns);
      lock_step_(time_ns);
      reply(replies, t.sequence, 0, t.length);
    } else if (kind == 0x80 && request == get_descriptor) {
      const Bytes found = descriptor(t.setup[3], t.setup[2]);
      found.empty() ? stall() : give(found);
    } else if ((kind & 0xE0U) == 0x80 && request == get_status) {
      give(std::array<std::uint8_t, 2>{});
    } else if (kind == 0x02 && request == clear_feature) {
      UsbFaults::Stall& stalled = t.setup[4] == 0x84 ? faults.stall_in : faults.stall_out;
      if (stalled == UsbFaults::Stall::once) stalled = UsbFaults::Stall::none;
      reply(replies, t.sequence, 0, 0);
    } else if ((kind & 0xE0U) == 0) {  // address, configuration, setting: taken
      if (request == set_configuration) configured_ = true;
      reply(replies, t.sequence, 0, t.length);
    } else {
      stall();
    }
  }
  void bulk_out(const Transfer& t, std::int64_t now_ns, Bytes& replies) {
    if (faults.stall_out != UsbFaults::Stall::none) {
      reply(replies, t.sequence, status_stall, 0);
      return;
    }
    reply(replies, t.sequence, 0, t.length);
    if (board_.take(t.data) != UsbBoardModel::Taken::request || faults.silent) return;
    const UsbBoardModel::Image image = board_.image();
    Answer answer{.bytes = Bytes(image.begin(), image.end()), .due_ns = now_ns + faults.late_ns};
    faults.spoil(answer.bytes, random_);
    if (faults.late_count > 0 && --faults.late_count == 0) faults.late_ns = 0;
    answers_.push_back(std::move(answer));
    give_answers(now_ns, replies);
  }
  [[nodiscard]] Bytes descriptor(std::uint8_t type, std::uint8_t index) const {
    const auto low = [](std::uint16_t value) { return static_cast<std::uint8_t>(value & 0xFFU); };
    const auto high = [](std::uint16_t value) { return static_cast<std::uint8_t>(value >> 8U); };
    const std::uint16_t vendor = identity_.vendor_id;
    const std::uint16_t product = identity_.product_id;
    switch (type) {
      case 1:  // device: USB 2.0, vendor's class, 64 bytes on endpoint 0
        return {18,   1,    0x00, 0x02, 0xFF, 0, 0, 64, low(vendor), high(vendor), low(product), high(product),
                0x00, 0x01, 1,    2,    3,    1};
      case 2: {  // configuration, interface, endpoints
        Bytes bytes{9, 2, 0, 0, 1, 1, 0, 0x80, 50};
        const Bytes setting{9, 4, 0, 0, 4, 0xFF, 0, 0, 0};
        bytes.insert(bytes.end(), setting.begin(), setting.end());
        for (const std::uint8_t address : std::array<std::uint8_t, 4>{0x02, 0x84, 0x06, 0x88}) {
          const Bytes endpoint{7, 5, address, 2, 0x00, 0x02, 0};  // bulk, 512 bytes
          bytes.insert(bytes.end(), endpoint.begin(), endpoint.end());
        }
        bytes[2] = static_cast<std::uint8_t>(bytes.size());
        return bytes;
      }
      case 3:
        switch (index) {
          case 0: return {4, 3, 0x09, 0x04};  // English
          case 1: return text_descriptor(identity_.manufacturer);
          case 2: return text_descriptor(identity_.product);
          case 3: return text_descriptor(identity_.serial);
          default: return {};
        }
      default: return {};
    }
  }

  UsbBoardModel& board_;
  UsbIdentity identity_;
  GoOnTo lock_step_;
  std::mt19937_64 random_;
  Bytes received_{};
  std::deque<Waiting> waiting_{};  ///< the host's reads without an answer
  std::deque<Answer> answers_{};   ///< answers that the host has not read yet
  std::uint64_t jtag_transfers_{0};
  bool configured_{false};
};

}  // namespace abs_hil::emulator
