// The emulated CAN node's answers, states and watchdog.
#include "emulator/can_node.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

namespace {

constexpr double full_duty = 10000.0;
/// A command's sequence may be at most this far ahead of the last one: the commands in between were lost.
constexpr unsigned most_commands_lost = 16;
/// A command's heartbeat may be at most this many measurements old.
constexpr unsigned most_heartbeat_age = 8;
/// A rejected command adds 2 to the level, an accepted one takes off 1. At this level the node latches.
constexpr int reject_limit = 20;
constexpr unsigned slow_every = 10;

/// CRC-8 SAE J1850 over identifier and data, as config/can/abs_rig.dbc describes the signal Check.
std::uint8_t crc_of(const BusFrame& frame) noexcept {
  unsigned crc = 0xFF;
  const auto add = [&crc](unsigned byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? (crc << 1U ^ 0x11DU) : crc << 1U;
  };
  add(frame.id & 0xFFU);
  add(frame.id >> 8U);
  for (std::size_t i = 0; i + 1 < frame.length; ++i) add(frame.data[i]);
  return static_cast<std::uint8_t>(crc ^ 0xFFU);
}

std::uint64_t bytes_of(const BusFrame& frame, std::size_t first, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = count; i > 0; --i) value = value * 256U + frame.data[first + i - 1];
  return value;
}

void put_bytes(BusFrame& frame, std::size_t first, std::size_t count, std::int64_t value) {
  auto rest = static_cast<std::uint64_t>(value);
  for (std::size_t i = 0; i < count; ++i, rest /= 256U) frame.data[first + i] = static_cast<std::uint8_t>(rest);
}

bool sound(const BusFrame& frame, unsigned length) {
  return frame.length == length && frame.data[length - 1] == crc_of(frame);
}

}  // namespace

void seal(BusFrame& frame) noexcept { frame.data[frame.length - 1U] = crc_of(frame); }

CanNode::CanNode(const CanNodeOptions& options)
    : RigBehind(options.plant, options.start_speed_rad_s), options_(options) {
  if (options.watchdog_ms < 1 || options.watchdog_ms > 10000) {
    throw std::invalid_argument("watchdog " + std::to_string(options.watchdog_ms) + " ms: give 1 to 10000");
  }
}

std::uint32_t CanNode::trip_flags() const noexcept {
  return (options_.supply_V < options_.supply_min_V ? 2U : 0U) | (overspeed_latched_ ? 1U : 0U) |
         (options_.temperature_C > options_.temperature_max_C ? 4U : 0U);
}

Outputs CanNode::outputs() const noexcept {
  if (state_ != State::active || trip_flags() != 0) return {};
  return {.drive_duty = emergency_stop() ? 0.0 : drive_, .brake_duty = std::clamp(brake_ + brake_error_, 0.0, 1.0)};
}

std::int64_t CanNode::watchdog_ends_ns() const noexcept {
  return last_command_ns_ + std::int64_t{options_.watchdog_ms} * rig::ns_per_ms;
}

void CanNode::become(State state, std::uint8_t latch_reason, const std::string& why) {
  state_ = state;
  latch_reason_ = latch_reason;
  brake_ = drive_ = 0.0;
  status_due_ = true;
  log_.add(time_ns(), why);
  note_outputs(why);
}

void CanNode::check_interlocks() {
  latch_overspeed(fastest_rad_s() > rad_s_of_rpm(options_.overspeed_rpm));
  if (trip_flags() != trip_told_) {
    trip_told_ = trip_flags();
    status_due_ = true;
    log_.add(time_ns(), rig::formatted("trip flags %u", trip_told_));
    note_outputs("interlock");
  }
}

std::int64_t CanNode::step_end_ns(std::int64_t next_ns) const noexcept {
  return guarded() ? std::clamp(watchdog_ends_ns(), time_ns(), next_ns) : next_ns;
}

void CanNode::after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) {
  if (guarded() && time_ns() >= watchdog_ends_ns()) become(State::latched, 1, "watchdog");
  check_interlocks();
}

std::uint8_t CanNode::trips_and_state() const noexcept {
  return static_cast<std::uint8_t>(trip_flags() | static_cast<unsigned>(state_) << 4U);
}

void CanNode::put_applied(BusFrame& frame, std::size_t first) const {
  const auto put = [&](std::size_t at, double duty) {
    put_bytes(frame, at, 2, std::llround(std::clamp(duty, 0.0, 1.0) * full_duty));
  };
  const Outputs out = outputs();
  put(first, out.brake_duty);
  put(first + 2, emergency_stop() ? drive_ : out.drive_duty);
}

void CanNode::receive(const BusFrame& frame) {
  switch (frame.id) {
    case 0x7F: on_time(frame); break;
    case 0x80: on_sync(frame); break;
    case 0x81: on_command(frame); break;
    case 0x82: on_control(frame); break;
    default: break;
  }
}

void CanNode::on_time(const BusFrame& frame) {
  if (!options_.lock_step || !sound(frame, 8)) return;
  constexpr std::uint64_t range = std::uint64_t{1} << 48U;
  constexpr std::uint64_t most_ns = 10'000'000'000;  // a longer jump does not occur in a run
  const std::uint64_t host_time = bytes_of(frame, 0, 6);
  const std::uint64_t step = (host_time - host_time_) % range;
  host_time_ = host_time;
  if (std::exchange(host_time_known_, true) && step <= most_ns) advance_to(time_ns() + static_cast<std::int64_t>(step));
}

void CanNode::on_sync(const BusFrame& frame) {
  if (!sound(frame, 2)) return;
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

void CanNode::reject(const char* why) {
  ++rejected_;
  if (state_ != State::active) return;
  reject_level_ += 2;
  if (reject_level_ >= reject_limit) become(State::latched, 2, std::string("too many commands rejected: ") + why);
}

void CanNode::on_command(const BusFrame& frame) {
  ++writes_;
  if (!sound(frame, 8)) return reject("wrong length or checksum");
  const double brake = static_cast<double>(bytes_of(frame, 0, 2)) / full_duty;
  const double drive = static_cast<double>(bytes_of(frame, 2, 2)) / full_duty;
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

void CanNode::on_control(const BusFrame& frame) {
  if (!sound(frame, 8)) return;
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

void CanNode::activate(const BusFrame& frame) {
  ++writes_;
  const std::uint64_t watchdog_ms = bytes_of(frame, 3, 2);
  // Only a host that has just asked knows the nonce, so a repeated or recorded activation has no effect.
  if (bytes_of(frame, 1, 2) != nonce_ || watchdog_ms > 10000) return;
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

void CanNode::send(BusFrame frame) {
  seal(frame);
  answers_.push_back(frame);
}

void CanNode::send_status() {
  BusFrame frame{.id = 0x90, .length = 8};
  frame.data[0] = trips_and_state();
  frame.data[1] = latch_reason_;
  put_bytes(frame, 2, 2, std::llround(std::clamp(options_.supply_V, 0.0, 65.534) * 1000.0));
  put_bytes(frame, 4, 2, std::llround(std::clamp(options_.temperature_C, -300.0, 300.0) * 100.0));
  frame.data[6] = sync_sequence_;
  send(frame);
}

void CanNode::send_outputs() {
  BusFrame frame{.id = 0x91, .length = 8};
  put_applied(frame, 0);
  frame.data[4] = static_cast<std::uint8_t>(rejected_);
  frame.data[5] = command_sequence_;
  frame.data[6] = sync_sequence_;
  send(frame);
}

void CanNode::send_encoders(bool fd) {
  const std::int64_t upper = position(true) - upper_zero_;
  const std::int64_t lower = position(false) - lower_zero_;
  const std::int64_t time_us = time_ns() / 1000;
  if (fd) {
    BusFrame frame{.id = 0x94, .length = 24, .fd = true};
    put_bytes(frame, 0, 4, upper);
    put_bytes(frame, 4, 4, lower);
    put_bytes(frame, 12, 4, time_us);
    put_applied(frame, 16);
    frame.data[20] = trips_and_state();
    frame.data[21] = command_sequence_;
    frame.data[22] = sync_sequence_;
    send(frame);
    return;
  }
  BusFrame encoders{.id = 0x92, .length = 8};
  put_bytes(encoders, 0, 3, upper);
  put_bytes(encoders, 3, 3, lower);
  encoders.data[6] = sync_sequence_;
  send(encoders);
  BusFrame latch{.id = 0x93, .length = 8};
  put_bytes(latch, 0, 4, time_us);
  put_bytes(latch, 4, 2, std::int64_t{static_cast<unsigned>(state_)} << 12U);  // the lever is at rest
  latch.data[6] = sync_sequence_;
  send(latch);
}

void CanNode::send_identity() {
  BusFrame frame{.id = 0x9A, .length = 8};
  frame.data[0] = 1;
  frame.data[1] = static_cast<std::uint8_t>((options_.lock_step ? 1U : 0U) | (options_.can_fd ? 2U : 0U));
  put_bytes(frame, 2, 2, nonce_);
  put_bytes(frame, 4, 2, options_.watchdog_ms);
  send(frame);
}

std::vector<BusFrame> CanNode::take_answers() { return std::exchange(answers_, {}); }

}  // namespace abs_hil::emulator
