// Makes a HostMot2 board safe from a second process.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "driver/hm2/hm2_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"

namespace abs_hil::driver::hm2 {

namespace {

constexpr std::int64_t answer_ns = 5'000'000;
/// A board that answers again after so many silent looks in a row may have come back with another firmware.
constexpr int silent_looks_most = 3;

/// Bases and strides that all firmware known to us has. A board whose answers are lost must get its zeros too.
Board usual_board() {
  constexpr std::uint16_t stride = 256;
  Board board;
  board.ports = 2;
  board.watchdog = {.instances = 1, .base = 0x0C00, .register_stride = stride, .instance_stride = 4};
  board.port = {.instances = 2, .base = 0x1000, .register_stride = stride, .instance_stride = 4};
  board.pwm = {.instances = 2, .base = 0x4000, .register_stride = stride, .instance_stride = 4};
  return board;
}

/// The link while a board is identified, which takes many datagrams, and 20 ms for each that is lost.
class Identifying final : public Link {
 public:
  /// @param zeros     sent before each datagram; null: they have been seen to act
  /// @param until_ns  then it waits no longer
  Identifying(Link& link, const Packet* zeros, std::int64_t until_ns)
      : link_(link), zeros_(zeros), until_ns_(until_ns) {}
  int send(std::span<const std::uint8_t> bytes) noexcept override {
    if (zeros_ != nullptr) static_cast<void>(link_.send(zeros_->bytes()));
    return link_.send(bytes);
  }
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t deadline_ns) noexcept override {
    return link_.receive(buffer, std::min(deadline_ns, until_ns_));
  }

 private:
  Link& link_;
  const Packet* zeros_;
  std::int64_t until_ns_;
};

class Hm2SafeState final : public SafeStateWriter {
 public:
  Hm2SafeState(const Hm2Options& options, OpenLink open_link) : options_(options), open_link_(std::move(open_link)) {
    number_ = static_cast<std::uint32_t>(monotonic_ns()) ^ static_cast<std::uint32_t>(::getpid()) << 8U;
    learn(usual_board());
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "hm2"; }
  /// Reads the board's descriptors.
  void prepare() override {
    if (!link_) link_ = open_link_();
    identify(*link_);
  }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return hm2_make_safe_bound_ns; }
  [[nodiscard]] bool works_beside_owner() const noexcept override { return true; }
  [[nodiscard]] IoResult make_safe() noexcept override {
    if (!known_ && (!again_.due() || !find_board())) {
      const int error = link_ ? link_->send(zeros_.bytes()) : socket_error_;
      const bool sent = link_ && error == 0;
      return {sent ? IoError::no_answer : IoError::disconnected, direction_, error, rig::Reason::hm2_silent};
    }
    if (const int error = link_->send(zeros_.bytes()); error != 0) {
      return {IoError::disconnected, direction_, error, rig::Reason::hm2_silent};
    }
    const IoResult seen = look(answer_ns);
    return known_ ? seen : make_safe();  // of a board that came back, what it shows has to be found first
  }
  /// Reads the direction of all pins; while all are inputs nothing is driven.
  [[nodiscard]] IoResult verify_safe() noexcept override {
    if (!known_) return make_safe();
    const IoResult seen = look(answer_ns);
    if (seen.ok()) return seen;
    const IoResult made_safe = make_safe();
    if (seen.error != IoError::read_back_mismatch) return made_safe;
    return {IoError::foreign_writer, direction_, 0, rig::Reason::foreign_writer};
  }

 private:
  /// Where the board has what is written: as all known firmware has it, until its descriptors have been read.
  void learn(const Board& board) noexcept {
    ports_ = board.ports;
    direction_ = board.port.address(reg::direction);
    zeros_ = safe_packet(board, {board.pwm.address(reg::value, static_cast<unsigned>(options_.drive_pwm)),
                                 board.pwm.address(reg::value, static_cast<unsigned>(options_.brake_pwm))});
  }
  void identify(Link& link) {
    known_ = false;
    learn(read_board(link, options_.address, number_));
    known_ = true;
  }
  [[nodiscard]] bool find_board() noexcept {
    try {
      if (!link_) link_ = open_link_();
      if (!link_) return false;
      static_cast<void>(link_->send(zeros_.bytes()));
      const IoResult seen = look(answer_ns);
      if (seen.error == IoError::no_answer) return false;
      // The first call of a caller must not take long, even where answers are lost.
      constexpr std::int64_t first_ns = 20'000'000;
      const bool first = !std::exchange(tried_, true);
      Identifying link(*link_, seen.ok() ? nullptr : &zeros_, first ? monotonic_ns() + first_ns : INT64_MAX);
      identify(link);
      return true;
    } catch (const NoSocket& error) {
      socket_error_ = error.errno_value;
      return false;
    } catch (...) {
      return false;  // the usual addresses serve until the board can be read
    }
  }
  [[nodiscard]] IoResult look(std::int64_t wait_ns) noexcept {
    Packet packet;
    const std::size_t where = packet.read(space::hostmot2, direction_, ports_);
    std::array<std::uint8_t, 4 * most_ports> answer{};
    if (!ask(*link_, packet, answer, number_, wait_ns, 1)) {
      ++silent_looks_;
      return {IoError::no_answer, direction_, 0, rig::Reason::hm2_silent};
    }
    if (std::exchange(silent_looks_, 0) >= silent_looks_most && std::exchange(known_, false)) {
      return {IoError::no_answer, direction_, 0, rig::Reason::hm2_silent};
    }
    for (unsigned port = 0; port < ports_; ++port) {
      if (word32(answer, where + std::size_t{4} * port) != 0) return {IoError::read_back_mismatch, direction_};
    }
    return {};
  }

  Hm2Options options_;
  OpenLink open_link_;
  std::unique_ptr<Link> link_{};
  int socket_error_{0};  ///< why there is no link
  bool known_{false};    ///< its descriptors have been read
  bool tried_{false};    ///< to identify it
  int silent_looks_{0};  ///< in a row
  Reopening again_{};
  std::uint32_t number_{0};
  std::uint16_t direction_{0};
  unsigned ports_{0};
  Packet zeros_{};
};

}  // namespace

std::unique_ptr<SafeStateWriter> safe_state_writer(const Hm2Options& options, OpenLink open_link) {
  return std::make_unique<Hm2SafeState>(options, std::move(open_link));
}

}  // namespace abs_hil::driver::hm2
