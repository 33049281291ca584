#pragma once

// A HostMot2 board for tests, in this process and in virtual time: registers, watchdog, two counters, two PWMs, and the
// rig behind it. It was written from the facts about the protocol alone and shares no line with driver or emulator.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "driver/hm2/hm2_driver.hpp"
#include "emulator/rig_behind.hpp"

namespace abs_hil::test {

class RegisterBoard final : public emulator::RigBehind {
 public:
  using Bytes = std::vector<std::uint8_t>;

  explicit RegisterBoard(double start_speed_rad_s = 0.0, const plant_sim::PlantOptions& plant = {})
      : RigBehind({.plant = plant, .start_speed_rad_s = start_speed_rad_s}) {
    const std::array<std::uint32_t, 16> idrom{
        3, 64, 512, text("MESA"), text("7I92"), 9, 34, 2, 34, 17, 100'000'000, 200'000'000, 4, 64, 256, 4};
    rom[0x100] = 0x55AACAFE;
    rom[0x104] = text("HOST");
    rom[0x108] = text("MOT2");
    rom[0x10C] = 0x400;
    for (std::size_t i = 0; i < idrom.size(); ++i) rom[static_cast<std::uint16_t>(0x400 + 4 * i)] = idrom[i];
    const std::array<std::array<std::uint32_t, 3>, 4> modules{{{0x01010002, 0x00030C00, 0},
                                                               {0x02010003, 0x00051000, 0x1F},
                                                               {0x02010204, 0x00053000, 3},
                                                               {0x02020006, 0x00054000, 3}}};
    for (std::size_t m = 0; m < modules.size(); ++m) {
      for (std::size_t w = 0; w < 3; ++w) rom[static_cast<std::uint16_t>(0x440 + 12 * m + 4 * w)] = modules[m][w];
    }
    for (std::uint16_t pin = 0; pin < 34; ++pin) rom[static_cast<std::uint16_t>(0x600 + 4 * pin)] = 0x03000000;
    const auto set_pin = [this](unsigned pin, std::uint32_t low) {
      rom[static_cast<std::uint16_t>(0x600 + 4 * pin)] = 0x03000000 | low;
    };
    set_pin(1, 0x000681);
    set_pin(18, 0x010681);
    for (unsigned k = 0; k < 3; ++k) {
      set_pin(13 + k, 0x000401 + k);
      set_pin(30 + k, 0x010401 + k);
    }
    info_ = {'7', 'I', '9', '2'};
    info_[0x10] = 3;
    info_[0x12] = 16;
    eeprom_ = {0, 0, 0x10, 0x3B, 0x60, 0x1B, 0, 0};
  }

  /// What acts on the rig: the pins are pulled high, and high is off.
  [[nodiscard]] emulator::Outputs outputs() const noexcept override {
    return {.drive_duty = duty(0, 1), .brake_duty = duty(1, 18 - 17)};
  }
  /// Takes a datagram; the answer is empty if it reads nothing.
  Bytes handle(std::span<const std::uint8_t> request) {
    ++received.all;
    if (counts_udp) ++received.udp;
    Bytes answer;
    for (std::size_t i = 0; i + 4 <= request.size();) {
      const unsigned word = request[i] | request[i + 1] << 8U;
      std::uint16_t address = static_cast<std::uint16_t>(request[i + 2] | request[i + 3] << 8U);
      i += 4;
      const unsigned width = 1U << ((word >> 8U) & 3U);
      for (unsigned unit = 0; unit < (word & 0x7FU); ++unit) {
        std::uint32_t value = 0;
        if ((word & 0x8000U) != 0) {
          for (unsigned b = 0; b < width && i < request.size(); ++b) value |= std::uint32_t{request[i++]} << (8U * b);
          write((word >> 10U) & 7U, address, value);
        } else {
          value = read((word >> 10U) & 7U, address);
          for (unsigned b = 0; b < width; ++b) answer.push_back(static_cast<std::uint8_t>(value >> (8U * b)));
        }
        if ((word & 0x80U) != 0) address = static_cast<std::uint16_t>(address + width);
      }
    }
    if (received.all == bites_after) bite();
    return answer;
  }
  void bite() {
    armed_ = false;
    bitten = 1;
    ddr_ = {};
  }
  /// As if the last packet had come from the driver.
  void forget_last_packet() {
    --received.all;
    --received.udp;
  }
  /// As after a loss of its supply.
  void restart() {
    bite();
    pwm_ = {};
    scratch_ = {};
    received = {};
  }
  [[nodiscard]] const std::array<std::uint32_t, 2>& ddr() const { return ddr_; }
  [[nodiscard]] std::int64_t last_edge_ns(bool upper) const { return edge_ns_[upper ? 1 : 0]; }

  std::map<std::uint16_t, std::uint32_t> rom{};      ///< identity and descriptors
  std::map<std::uint16_t, std::uint32_t> written{};  ///< last value of each register of HostMot2
  std::uint64_t writes{0};
  driver::hm2::Received received{};
  bool counts_udp{true};
  bool stamps_edges{true};
  std::uint32_t bitten{1};
  std::array<std::uint32_t, 2> control{};            ///< bits that the counters report beside what was written
  std::uint16_t counters{0x3000};                    ///< their base
  std::array<unsigned, 2> counters_of_wheels{0, 1};  ///< of the lower and the upper one
  std::uint32_t broken_pins{0};                      ///< pins of port 1 that never become outputs
  int time_jump_counts{0};
  std::uint16_t bites_after{0};  ///< so many packets: the program that drove it has ended its outputs; 0: never
  std::array<std::uint8_t, 0x20> info_{};

 private:
  static std::uint32_t text(const char* four) {
    std::uint32_t word = 0;
    std::memcpy(&word, four, 4);
    return word;
  }
  [[nodiscard]] std::uint32_t reg(std::uint16_t address) const {
    const auto found = written.find(address);
    return found == written.end() ? 0 : found->second;
  }
  [[nodiscard]] double duty(std::size_t pwm, unsigned pin_of_port) const {
    const std::size_t port = pwm;
    const std::uint32_t bit = 1U << pin_of_port;
    const auto at = [&](std::uint16_t base) { return reg(static_cast<std::uint16_t>(base + 4 * port)); };
    if ((ddr_[port] & bit) == 0) return 0.0;
    const double high = (at(0x1200) & bit) != 0   ? (pwm_[pwm] >> 16U & 0xFFFU) / 4096.0
                        : (at(0x1000) & bit) != 0 ? 1.0
                                                  : 0.0;
    return (at(0x1400) & bit) != 0 ? high : 1.0 - high;
  }
  [[nodiscard]] std::uint32_t count(bool upper) const {
    return static_cast<std::uint16_t>(position(upper) + time_jump_counts);
  }
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override {
    return armed_ ? std::min(next_ns, std::max(bites_ns_, time_ns() + 1)) : next_ns;
  }
  void after_step(const plant_sim::PlantState& before, std::int64_t from_ns) override {
    stamp(true, before.angle1_rad, plant().state().angle1_rad, from_ns);
    stamp(false, before.angle2_rad, plant().state().angle2_rad, from_ns);
    if (armed_ && time_ns() >= bites_ns_) bite();
  }
  /// Time of the last edge of a step at constant speed: the share of its way at which its last count begins.
  void stamp(bool upper, double from_rad, double to_rad, std::int64_t from_ns) {
    const std::int64_t last = position_at(upper, to_rad);
    if (last == position_at(upper, from_rad)) return;
    double without = 0.0;
    double with = 1.0;
    while (with - without > 1e-6) {
      const double share = (without + with) / 2;
      (position_at(upper, from_rad + share * (to_rad - from_rad)) == last ? with : without) = share;
    }
    edge_ns_[upper ? 1 : 0] = from_ns + std::llround(with * static_cast<double>(time_ns() - from_ns));
  }
  [[nodiscard]] std::uint32_t ticks(std::int64_t at_ns) const {
    if (!stamps_edges) return 0;
    return static_cast<std::uint16_t>(at_ns /
                                      (10 * (std::int64_t{reg(static_cast<std::uint16_t>(counters + 0x200))} + 2)));
  }
  [[nodiscard]] std::uint32_t read_counter(std::uint16_t address) const {
    const unsigned instance = (address & 0xFFU) / 4;
    const bool upper = instance == counters_of_wheels[1];
    if (address == counters + 0x300) return ticks(time_ns());
    if (!upper && instance != counters_of_wheels[0]) return 0;
    if ((address & 0xFF00) == counters) return count(upper) | ticks(edge_ns_[upper ? 1 : 0]) << 16U;
    if ((address & 0xFF00) == counters + 0x100) return reg(address) | control[upper ? 1 : 0];
    return 0;
  }
  std::uint32_t read(unsigned space, std::uint16_t address) {
    if (space == 0) {
      if (const auto found = rom.find(address); found != rom.end()) return found->second;
      switch (address) {
        case 0x0D00: return bitten;
        case 0x1100: return ddr_[0];
        case 0x1104: return ddr_[1];
        default: return read_counter(address);
      }
    }
    const auto word = [&](const auto& bytes) {
      return address + 1U < bytes.size() ? static_cast<std::uint32_t>(bytes[address] | bytes[address + 1U] << 8U) : 0U;
    };
    if (space == 2) return word(eeprom_);
    if (space == 4) {
      if (address == 0) return static_cast<std::uint16_t>(time_ns() / 1000);
      return address >= 0x10 && address < 0x18 ? word_of_scratch(address) : 0;
    }
    if (space == 6) return address == 8 ? received.all : address == 10 ? received.udp : 0;
    return space == 7 ? word(info_) : 0;
  }
  [[nodiscard]] std::uint32_t word_of_scratch(std::uint16_t address) const {
    return static_cast<std::uint32_t>(scratch_[address - 0x10U] | scratch_[address - 0x0FU] << 8U);
  }
  void write(unsigned space, std::uint16_t address, std::uint32_t value) {
    if (space == 4 && address >= 0x10 && address < 0x18) {
      scratch_[address - 0x10U] = static_cast<std::uint8_t>(value);
      scratch_[address - 0x0FU] = static_cast<std::uint8_t>(value >> 8U);
    }
    if (space != 0) return;
    ++writes;
    written[address] = value;
    if (address == 0x0C00) arm(value);
    if (address == 0x0D00) bitten = value & 1U;
    if (address == 0x0E00 && value >> 24U == 0x5A) arm(reg(0x0C00));
    if (address == 0x1100) ddr_[0] = value;
    if (address == 0x1104) ddr_[1] = value & ~broken_pins;
    if (address == 0x4000 || address == 0x4004) pwm_[(address - 0x4000U) / 4] = value;
  }
  void arm(std::uint32_t time) {
    if (time <= 1) return bite();
    armed_ = true;
    bites_ns_ = time_ns() + std::int64_t{time + 1} * 10;
  }

  bool armed_{false};
  std::int64_t bites_ns_{0};
  std::array<std::int64_t, 2> edge_ns_{};  ///< of the lower and the upper wheel's last count
  std::array<std::uint32_t, 2> ddr_{};
  std::array<std::uint32_t, 2> pwm_{};
  std::array<std::uint8_t, 8> scratch_{};
  std::array<std::uint8_t, 8> eeprom_{};
};

/// The cable between a driver and a board, with its faults.
class Cable {
 public:
  explicit Cable(RegisterBoard& board) : board_(board) {}

  bool out{false};
  std::function<bool(const RegisterBoard::Bytes&)> loses_request = [](const auto&) { return false; };
  std::function<bool(const RegisterBoard::Bytes&)> loses_answer = [](const auto&) { return false; };
  bool doubles_answers{false};
  bool delays_answers{false};  ///< each answer comes with the next one, after it

  [[nodiscard]] driver::hm2::OpenLink opener() {
    return [this] { return std::make_unique<End>(*this); };
  }

 private:
  class End final : public driver::hm2::Link {
   public:
    explicit End(Cable& cable) : cable_(cable) {}
    int send(std::span<const std::uint8_t> bytes) noexcept override {
      const RegisterBoard::Bytes request(bytes.begin(), bytes.end());
      if (cable_.out || cable_.loses_request(request)) return 0;
      RegisterBoard::Bytes answer = cable_.board_.handle(request);
      if (answer.empty() || cable_.loses_answer(answer)) return 0;
      if (cable_.delays_answers) std::swap(answer, late_);
      if (answer.empty()) return 0;
      answers_.push_back(answer);
      if (cable_.doubles_answers) answers_.push_back(answer);
      return 0;
    }
    std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t) noexcept override {
      if (answers_.empty()) return 0;
      const RegisterBoard::Bytes answer = answers_.front();
      answers_.pop_front();
      std::copy_n(answer.begin(), std::min(answer.size(), buffer.size()), buffer.begin());
      return answer.size();
    }

   private:
    Cable& cable_;
    std::deque<RegisterBoard::Bytes> answers_{};
    RegisterBoard::Bytes late_{};
  };
  RegisterBoard& board_;
};

/// A driver that tells the board the time of each of its reads.
class TimedDriver final : public driver::RigDriver {
 public:
  TimedDriver(RegisterBoard& board, std::unique_ptr<driver::RigDriver> inner)
      : board_(board), inner_(std::move(inner)) {}
  ~TimedDriver() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return inner_->name(); }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return inner_->as_sent(command);
  }
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override { return inner_->outputs_now(applied); }

 private:
  void do_configure() override { inner_->configure(); }
  void do_activate(std::int64_t now_ns) override { inner_->activate(now_ns); }
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    board_.advance_to(now_ns);
    return inner_->read(now_ns, measurement);
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    return inner_->write(command, sent);
  }
  driver::IoResult do_make_safe() noexcept override { return inner_->deactivate(); }
  driver::IoResult do_rest() noexcept override { return inner_->rest(); }

  RegisterBoard& board_;
  std::unique_ptr<driver::RigDriver> inner_;
};

}  // namespace abs_hil::test
