// The emulated CAN node: its answers, states and watchdog, and faults of its frames.

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "emulator/rig_behind.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

/// One frame on the emulated node's bus.
struct BusFrame {
  std::uint32_t id{0};  ///< 11 bits
  std::uint8_t length{0};
  bool fd{false};
  std::array<std::uint8_t, 64> data{};

  /// CRC-8 SAE J1850 over identifier and data, as config/can/abs_rig.dbc describes the signal Check.
  [[nodiscard]] std::uint8_t crc() const noexcept {
    unsigned crc = 0xFF;
    const auto add = [&crc](unsigned byte) {
      crc ^= byte;
      for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? (crc << 1U ^ 0x11DU) : crc << 1U;
    };
    add(id & 0xFFU);
    add(id >> 8U);
    for (std::size_t i = 0; i + 1 < length; ++i) add(data[i]);
    return static_cast<std::uint8_t>(crc ^ 0xFFU);
  }
  /// Puts the correct checksum into the last byte.
  void seal() noexcept { data[length - 1U] = crc(); }
  [[nodiscard]] bool sound(unsigned bytes) const { return length == bytes && data[bytes - 1] == crc(); }
  [[nodiscard]] std::uint64_t bytes(std::size_t first, std::size_t count) const {
    std::uint64_t value = 0;
    for (std::size_t i = count; i > 0; --i) value = value * 256U + data[first + i - 1];
    return value;
  }
};

/// The CAN I/O node of docs/can.md with the simulated rig behind it. It latches its counters at a SYNC, applies
/// commands, and zeroes its outputs when valid commands stop. In lock-step ABS_TIME advances its time. It was written
/// only from config/can/abs_rig.dbc and shares no code with the driver.
class CanNode final : public RigBehind {
 public:
  enum class State : std::uint8_t { inactive = 0, active = 1, latched = 2 };

  /// Throws std::invalid_argument if an option is outside its range.
  explicit CanNode(const BoardOptions& options) : RigBehind(options) {
    log_ = OutputLog("last valid command");
    if (options.watchdog_ms < 1 || options.watchdog_ms > 10000) {
      throw std::invalid_argument("watchdog " + std::to_string(options.watchdog_ms) + " ms: give 1 to 10000");
    }
  }

  /// Takes any frame from the bus at the current time.
  void receive(const BusFrame& frame) {
    switch (frame.id) {
      case 0x7F: on_time(frame); break;
      case 0x80: on_sync(frame); break;
      case 0x81: on_command(frame); break;
      case 0x82: on_control(frame); break;
      default: break;
    }
  }
  /// The frames that it has sent since the last call, in order.
  [[nodiscard]] std::vector<BusFrame> take_answers() { return std::exchange(answers_, {}); }
  /// Fault of the power stage: from now on the brake's duty differs by `error` from the command.
  void break_brake_output(double error) noexcept { brake_error_ = error; }

  [[nodiscard]] Outputs outputs() const noexcept override {
    if (state_ != State::active || trip_flags() != 0) return {};
    return {.drive_duty = emergency_stop() ? 0.0 : drive_, .brake_duty = std::clamp(brake_ + brake_error_, 0.0, 1.0)};
  }
  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] std::uint32_t trip_flags() const noexcept {
    return (options_.supply_V < options_.supply_min_V ? 2U : 0U) | (overspeed_latched_ ? 1U : 0U) |
           (options_.temperature_C > options_.temperature_max_C ? 4U : 0U);
  }
  void stood_still(std::int64_t duration_ns) override {
    if (last_command_ns_ >= 0) last_command_ns_ += duration_ns;
  }
  /// Number of received activations, deactivations and commands, valid or not.
  [[nodiscard]] std::uint64_t writes() const noexcept { return writes_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }

 private:
  static constexpr double full_duty = 10000.0;
  /// A command's sequence may be at most this far ahead of the last one: the commands in between were lost.
  static constexpr unsigned most_commands_lost = 16;
  /// A command's heartbeat may be at most this many measurements old.
  static constexpr unsigned most_heartbeat_age = 8;
  /// A rejected command adds 2 to the level, an accepted one takes off 1. At this level the node latches.
  static constexpr int reject_limit = 20;
  static constexpr unsigned slow_every = 10;

  void on_time(const BusFrame& frame) {
    if (!options_.lock_step || !frame.sound(8)) return;
    constexpr std::uint64_t range = std::uint64_t{1} << 48U;
    constexpr std::uint64_t most_ns = 10'000'000'000;  // a longer jump does not occur in a run
    const std::uint64_t host_time = frame.bytes(0, 6);
    const std::uint64_t step = (host_time - host_time_) % range;
    host_time_ = host_time;
    if (std::exchange(host_time_known_, true) && step <= most_ns)
      advance_to(time_ns() + static_cast<std::int64_t>(step));
  }
  void on_sync(const BusFrame& frame) {
    if (!frame.sound(2)) return;
    sync_sequence_ = frame.data[0];
    ++syncs_;
    const bool fd = frame.fd && options_.can_fd;
    // Send the slow frames first: the answer must end with the frame for which the host waits.
    const bool in_trouble =
        trip_flags() != 0 || state_ == State::latched;  // sent with every answer, because one may be lost
    if (std::exchange(status_due_, false) || in_trouble || syncs_ % slow_every == 0) send_status();
    if (!fd && syncs_ % slow_every == slow_every / 2) send_outputs();
    send_encoders(fd);
  }
  void on_command(const BusFrame& frame) {
    ++writes_;
    if (!frame.sound(8)) return reject("wrong length or checksum");
    const double brake = static_cast<double>(frame.bytes(0, 2)) / full_duty;
    const double drive = static_cast<double>(frame.bytes(2, 2)) / full_duty;
    const bool enable = (frame.data[4] & 1) != 0;
    const auto heartbeat_age = static_cast<std::uint8_t>(sync_sequence_ - frame.data[5]);
    const auto ahead = static_cast<std::uint8_t>(frame.data[6] - command_sequence_);
    if (brake > 1.0 || drive > 1.0) return reject("duty out of range");
    if (ahead < 1 || ahead > most_commands_lost) return reject("sequence stale or repeated");
    if (heartbeat_age > most_heartbeat_age) return reject("heartbeat too old: computed from an old measurement");
    if (state_ != State::active) return;
    command_sequence_ = frame.data[6];
    last_command_ns_ = time_ns();
    reject_level_ = std::max(0, reject_level_ - 1);
    brake_ = brake;
    drive_ = enable ? drive : 0.0;
    note_outputs("commanded");
  }
  void on_control(const BusFrame& frame) {
    if (!frame.sound(8)) return;
    switch (frame.data[0]) {
      case 1: send_identity(); break;
      case 2: activate(frame); break;
      case 3:
        ++writes_;
        if (state_ != State::inactive) become(State::inactive, 0, "deactivated");
        send_status();
        send_outputs();
        break;
      default: break;
    }
  }
  void activate(const BusFrame& frame) {
    ++writes_;
    const std::uint64_t watchdog_ms = frame.bytes(3, 2);
    // Only a host that has just asked knows the nonce, so a repeated or recorded activation has no effect.
    if (frame.bytes(1, 2) != nonce_ || watchdog_ms > 10000) return;
    nonce_ = static_cast<std::uint16_t>(nonce_ * 25173U + 13849U);
    if (watchdog_ms != 0) options_.watchdog_ms = static_cast<std::uint16_t>(watchdog_ms);
    command_sequence_ = frame.data[6];
    last_command_ns_ = -1;
    reject_level_ = 0;
    upper_zero_ = position(true);
    lower_zero_ = position(false);
    syncs_ = 0;
    host_time_known_ = false;
    become(State::active, 0, "activated");
    send_status();
    send_outputs();
  }
  void become(State state, std::uint8_t latch_reason, const std::string& why) {
    state_ = state;
    latch_reason_ = latch_reason;
    brake_ = drive_ = 0.0;
    status_due_ = true;
    log_.add(time_ns(), why);
    note_outputs(why);
  }
  void reject(const char* why) {
    ++rejected_;
    if (state_ != State::active) return;
    reject_level_ += 2;
    if (reject_level_ >= reject_limit) become(State::latched, 2, std::string("too many commands rejected: ") + why);
  }
  void check_interlocks() {
    latch_overspeed(fastest_rad_s() > rad_s_of_rpm(options_.overspeed_rpm));
    if (trip_flags() != trip_told_) {
      trip_told_ = trip_flags();
      status_due_ = true;
      log_.add(time_ns(), rig::formatted("trip flags %u", trip_told_));
      note_outputs("interlock");
    }
  }
  [[nodiscard]] std::int64_t last_reload_ns() const noexcept override { return last_command_ns_; }
  [[nodiscard]] std::uint8_t trips_and_state() const noexcept {
    return static_cast<std::uint8_t>(trip_flags() | static_cast<unsigned>(state_) << 4U);
  }
  /// The duties that act, as words.
  [[nodiscard]] static std::int64_t word_of(double duty) {
    return std::llround(std::clamp(duty, 0.0, 1.0) * full_duty);
  }
  [[nodiscard]] std::int64_t brake_word() const { return word_of(outputs().brake_duty); }
  [[nodiscard]] std::int64_t drive_word() const { return word_of(emergency_stop() ? drive_ : outputs().drive_duty); }
  struct Field {
    std::uint8_t bytes;
    std::int64_t value;
  };
  /// Sends a frame of these fields, low bytes first, with its checksum behind them.
  void send(std::uint32_t id, std::initializer_list<Field> fields, bool fd = false) {
    BusFrame frame{.id = id, .fd = fd};
    for (const Field& field : fields) {
      auto rest = static_cast<std::uint64_t>(field.value);
      for (int i = 0; i < field.bytes; ++i, rest /= 256U) frame.data[frame.length++] = static_cast<std::uint8_t>(rest);
    }
    ++frame.length;
    frame.seal();
    answers_.push_back(frame);
  }
  void send_status() {
    const std::int64_t supply_mV = std::llround(std::clamp(options_.supply_V, 0.0, 65.534) * 1000.0);
    const std::int64_t temperature_cC = std::llround(std::clamp(options_.temperature_C, -300.0, 300.0) * 100.0);
    send(0x90, {{1, trips_and_state()}, {1, latch_reason_}, {2, supply_mV}, {2, temperature_cC}, {1, sync_sequence_}});
  }
  void send_outputs() {
    const auto rejected = static_cast<std::int64_t>(rejected_);
    send(0x91, {{2, brake_word()}, {2, drive_word()}, {1, rejected}, {1, command_sequence_}, {1, sync_sequence_}});
  }
  void send_encoders(bool fd) {
    const std::int64_t upper = position(true) - upper_zero_;
    const std::int64_t lower = position(false) - lower_zero_;
    const std::int64_t time_us = time_ns() / 1000;
    constexpr std::int64_t lever = 0;  // it is at rest
    if (fd) {
      send(0x94,
           {{4, upper},
            {4, lower},
            {4, lever},
            {4, time_us},
            {2, brake_word()},
            {2, drive_word()},
            {1, trips_and_state()},
            {1, command_sequence_},
            {1, sync_sequence_}},
           true);
      return;
    }
    send(0x92, {{3, upper}, {3, lower}, {1, sync_sequence_}});
    send(0x93, {{4, time_us}, {2, lever | std::int64_t{static_cast<unsigned>(state_)} << 12U}, {1, sync_sequence_}});
  }
  void send_identity() {
    const unsigned knows = (options_.lock_step ? 1U : 0U) | (options_.can_fd ? 2U : 0U);
    send(0x9A, {{1, 1}, {1, knows}, {2, nonce_}, {2, options_.watchdog_ms}, {1, 0}});
  }
  [[nodiscard]] bool guarded() const noexcept { return state_ == State::active && (brake_ > 0.0 || drive_ > 0.0); }
  [[nodiscard]] std::int64_t watchdog_ends_ns() const noexcept {
    return last_command_ns_ + std::int64_t{options_.watchdog_ms} * rig::ns_per_ms;
  }
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override {
    return guarded() ? std::clamp(watchdog_ends_ns(), time_ns(), next_ns) : next_ns;
  }
  void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override {
    if (guarded() && time_ns() >= watchdog_ends_ns()) become(State::latched, 1, "watchdog");
    check_interlocks();
  }

  State state_{State::inactive};
  std::uint8_t latch_reason_{0};
  double brake_{0.0};
  double drive_{0.0};
  double brake_error_{0.0};
  std::uint16_t nonce_{0x1234};
  std::uint8_t sync_sequence_{0};
  std::uint8_t command_sequence_{0};
  std::int64_t last_command_ns_{-1};  ///< time of the last accepted command; -1: none since the activation
  int reject_level_{0};
  std::uint64_t rejected_{0};
  std::uint64_t writes_{0};
  std::uint32_t syncs_{0};
  bool status_due_{true};
  std::uint32_t trip_told_{0};
  std::int64_t upper_zero_{0};
  std::int64_t lower_zero_{0};
  bool host_time_known_{false};
  std::uint64_t host_time_{0};
  std::vector<BusFrame> answers_{};
};

/// Applies a fault between a node and its bus. The names are those of the control command `fault NAME[=NUMBER]`.
class NodeFaults {
 public:
  explicit NodeFaults(std::uint64_t seed) : random_(seed) {}

  /// Sets a fault such as "stale=5". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  /// True if the node receives this frame.
  [[nodiscard]] bool hears(const BusFrame& frame) const noexcept;
  /// The frames of one answer that reach the bus.
  [[nodiscard]] std::vector<BusFrame> answer(std::vector<BusFrame> frames);

 private:
  struct Row;
  static const std::array<Row, 16> rows;

  std::size_t row_{0};
  unsigned number_{0};
  std::vector<BusFrame> kept_{};
  std::mt19937_64 random_;
};

}  // namespace abs_hil::emulator
