#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// The part of a HostMot2's registers that never changes: cookie, IDROM, module and pin descriptors of the firmware
/// G540x2 on a 7I92.
struct Hm2Identity {
  explicit Hm2Identity(const Hm2Words& others = {});

  [[nodiscard]] std::uint32_t word(std::uint32_t address) const noexcept {
    return address / 4 < words.size() ? words[address / 4] : 0;
  }

  std::vector<std::uint32_t> words;
  std::uint16_t lbp_version{3};  ///< that the board reports, as the next
  std::uint16_t firmware_version{17};
};

/// A board that a host talks to by datagrams, with the rig behind it.
class UdpBoard : public RigBehind {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  explicit UdpBoard(const BoardOptions& options) : RigBehind(options) {
    if (!options.name.empty() && options.name.size() <= 16) return;
    throw std::invalid_argument("board name \"" + options.name + "\": give 1 to 16 characters");
  }

  /// Obeys a datagram at the current time. Returns the answer; empty: there is none.
  [[nodiscard]] virtual std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) = 0;
  /// Switches the board off and on: all registers as after power-on. The wheels go on turning.
  virtual void power_cycle() = 0;
  /// The watchdog bites now.
  virtual void bite() = 0;
  /// Sets the quadrature error bit of a wheel's counter, as a wrong edge does, if the board has one.
  virtual void make_quadrature_error(bool /*upper_wheel*/) {}
  void press_emergency_stop(bool pressed) override {
    RigBehind::press_emergency_stop(pressed);
    note_outputs("emergency stop");
  }

  [[nodiscard]] virtual bool bitten() const noexcept = 0;
  /// True while any pin is an output.
  [[nodiscard]] virtual bool drives_pins() const noexcept = 0;
  /// Datagrams with a command that writes something that acts: activations, commands, zeros.
  [[nodiscard]] std::uint64_t writes() const noexcept { return writes_; }
  /// All registers that a host has set, also those that it cannot read: "1100=00020002 ...".
  [[nodiscard]] virtual std::string registers_text() const = 0;

 protected:
  std::uint64_t writes_{0};
};

inline constexpr std::uint16_t hm2_port = 27181;
inline constexpr std::size_t largest_hm2_answer = 1472;

/// The Mesa 7I92T as a host sees it through UDP: LBP16 commands in a datagram, their answers in another one. Where the
/// documents are silent this project chose: a command that the space does not take reads as zeros and counts as an
/// error; a datagram that breaks off, or whose answer would not fit into a packet, is obeyed up to that command.
///
/// In lock-step, space 5, which no hardware uses, holds the board's time in ns (8 bytes, little-endian). A host
/// advances the time by a write of all 8 bytes.
/// Throws std::invalid_argument if an option is outside its range.
[[nodiscard]] std::unique_ptr<UdpBoard> hm2_board(const BoardOptions& options);

/// The node of docs/node.md: the core of its firmware, and the simulated rig behind its pins. Takes plant, start speed,
/// MAC, address, lock-step and channels from `options`. A name that begins with "7I92" makes it present itself as that
/// board. Throws std::invalid_argument as UdpBoard does.
[[nodiscard]] std::unique_ptr<UdpBoard> node_board(const BoardOptions& options);

/// A datagram to or from a host. `peer` stands for the host's address.
struct Hm2Datagram {
  std::vector<std::uint8_t> bytes{};
  std::uint64_t peer{0};
};

/// The cable between host and board, with its faults. `set` takes the text of the control command `fault`.
class Hm2Link {
 public:
  explicit Hm2Link(std::uint64_t seed) : random_(seed) {}

  /// Sets a fault such as "loss=5". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text) {
    static constexpr std::array<FaultName, 10> names{{
        {"ok"},                       // heals all of them
        {"loss=PERCENT", 0, 100},     // each datagram of both directions is lost with this probability
        {"lose-requests=N", 0, 1e6},  // so many of the next ones are lost
        {"lose-answers=N", 0, 1e6},
        {"delay=US", 0, 1e7},      // every answer comes later
        {"reorder"},               // answers leave in pairs, the later one first
        {"duplicate"},             // every answer comes twice
        {"stale"},                 // the answer before comes in place of each
        {"short=BYTES", 0, 1472},  // answers end after so many bytes
        {"garbage"},               // every answer is random bytes of its length
    }};
    const GivenFault given = fault_in(text, names);
    fault_ = names[given.place].name();
    number_ = given.number;
    kept_.reset();
  }
  /// Pulls or plugs the cable. What was under way is lost.
  void plug(bool in) {
    plugged_ = in;
    waiting_.clear();
    kept_.reset();
  }
  [[nodiscard]] bool plugged() const noexcept { return plugged_; }

  /// True if the board receives the next request.
  [[nodiscard]] bool request_arrives() { return !lost("lose-requests"); }
  /// Takes the board's answer.
  void send(Hm2Datagram answer, std::int64_t now_ns) {
    if (lost("lose-answers")) return;
    const auto leave = [this, now_ns](Hm2Datagram datagram) {
      const auto later_ns = fault_ == "delay" ? static_cast<std::int64_t>(number_ * 1000.0) : 0;
      waiting_.push_back({now_ns + later_ns, std::move(datagram)});
    };
    if (fault_ == "reorder" && !kept_) {
      kept_ = std::move(answer);
      return;
    }
    if (fault_ == "stale" && kept_) std::swap(*kept_, answer);
    if (fault_ == "stale" && !kept_) kept_ = answer;
    if (fault_ == "duplicate") leave(answer);
    if (fault_ == "short") answer.bytes.resize(std::min(answer.bytes.size(), static_cast<std::size_t>(number_)));
    if (fault_ == "garbage")
      std::ranges::generate(answer.bytes, [this] { return static_cast<std::uint8_t>(random_()); });
    leave(std::move(answer));
    if (fault_ == "reorder") leave(*std::exchange(kept_, std::nullopt));
  }
  /// The answers that reach their hosts by now.
  [[nodiscard]] std::vector<Hm2Datagram> take_due(std::int64_t now_ns) {
    std::vector<Hm2Datagram> due;
    for (Waiting& waiting : waiting_) {
      if (waiting.due_ns <= now_ns) due.push_back(std::move(waiting.answer));
    }
    std::erase_if(waiting_, [now_ns](const Waiting& waiting) { return waiting.due_ns <= now_ns; });
    return due;
  }
  /// When the next answer is due.
  [[nodiscard]] std::optional<std::int64_t> next_due_ns() const noexcept {
    std::optional<std::int64_t> next;
    for (const Waiting& waiting : waiting_) next = std::min(next.value_or(waiting.due_ns), waiting.due_ns);
    return next;
  }

 private:
  struct Waiting {
    std::int64_t due_ns{0};
    Hm2Datagram answer{};
  };
  [[nodiscard]] bool lost(std::string_view counted) {
    if (!plugged_) return true;
    if (fault_ == "loss") return std::uniform_real_distribution<double>(0.0, 100.0)(random_) < number_;
    if (fault_ != counted || number_ < 1.0) return false;
    number_ -= 1.0;
    return true;
  }

  bool plugged_{true};
  std::string_view fault_{"ok"};
  double number_{0.0};
  std::optional<Hm2Datagram> kept_{};
  std::vector<Waiting> waiting_{};
  std::mt19937_64 random_;
};

}  // namespace abs_hil::emulator
