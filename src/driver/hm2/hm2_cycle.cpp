// One cycle of the driver: the datagram that reads and what its answer tells, the datagram that writes. What the driver
// tells people of its board and of a run.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "abs_hil/rig/time_units.hpp"
#include "driver/board_kit.hpp"
#include "driver/hm2/hm2_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

bool Hm2Driver::await_answer(std::int64_t deadline_ns, CycleAnswer& answer) noexcept {
  std::array<std::uint8_t, 256> bytes{};
  constexpr int most = 64;  // a flood must not hold the cycle
  for (int i = 0; i < most; ++i) {
    const std::size_t size = link_->receive(bytes, deadline_ns);
    if (size == 0) break;
    if (!wire_.decode({bytes.data(), size}, answer)) {
      ++counters_.wrong_length;
    } else if (answer.read_number != read_number_) {
      ++counters_.stale;
    } else {
      return true;
    }
  }
  return false;
}

IoResult Hm2Driver::lost_answer() noexcept {
  ++counters_.unanswered;
  unanswered_ = true;
  took_other_ = false;
  bucket_.lost();
  return bucket_.tripped() ? silent(wire_.bitten) : IoResult{};
}

// Each datagram of ours raises the board's count by one, unless it is lost or late. A packet that is no datagram cannot
// command: the kernel's ARP must not end a run.
IoResult Hm2Driver::judge_talkers(const CycleAnswer& answer) noexcept {
  const auto all = static_cast<std::uint16_t>(answer.received.all - received_.all);
  const auto udp = static_cast<std::uint16_t>(answer.received.udp - received_.udp);
  const std::uint16_t came = counts_udp_ ? std::min(udp, all) : all;  // no datagram is not a packet
  const std::uint32_t ours = link_->sent() - sent_before_;
  const bool strict = driving_ && any_answer_;
  received_ = answer.received;
  sent_before_ = link_->sent();
  if (!strict) {
    missing_ = 0;
    return {};
  }
  if (counts_udp_ && all > udp) counters_.not_udp += static_cast<std::uint16_t>(all - udp);
  const std::uint32_t behind = write_number_ - answer.write_number;
  const bool is_ours = behind <= write_number_ - first_write_ && behind < commands_.size();
  if (!is_ours && answer.write_number == 0 && all_off(answer.direction)) {
    return {IoError::implausible_answer, at::write_number, 0, rig::Reason::hm2_restarted};
  }
  if (!is_ours || came > ours + missing_) {
    return {IoError::foreign_writer, is_ours ? at::received : at::write_number, 0, rig::Reason::foreign_writer};
  }
  constexpr int forgotten_after = 10;  // what has not come by then was lost
  constexpr std::uint32_t most_missing = 4;
  missing_ = std::min(missing_ + ours - came, most_missing);
  answers_since_missing_ = came < ours ? 0 : answers_since_missing_ + 1;
  if (answers_since_missing_ > forgotten_after) missing_ = 0;
  took_other_ = behind > 0;
  if (took_other_) {
    ++counters_.writes_lost;
    command_ = commands_[answer.write_number % commands_.size()];
    bucket_.lost();
    // After the run has ended for it, an answer counts again. Otherwise a board that is back would seem silent.
    if (bucket_.tripped() && fault_.ok()) return silent(at::write_number);
  } else {
    bucket_.good();
  }
  return {};
}

IoResult Hm2Driver::judge(const CycleAnswer& answer) noexcept {
  if (const IoResult talkers = judge_talkers(answer); !talkers.ok()) return talkers;
  const bool bitten = (answer.bitten & 1U) != 0;
  const bool as_set = std::ranges::equal(of_ports(answer.direction, board_), of_ports(pins_.outputs, board_));
  // The first write was lost, and the board has had none in time: still the slow start before the first write.
  if (driving_ && bitten && answer.write_number == first_write_) driving_ = false;
  if (driving_ && bitten) {
    return {IoError::read_back_mismatch, wire_.bitten, 0, rig::Reason::hm2_watchdog_bit};
  }
  if (driving_ && !as_set) {
    return {IoError::read_back_mismatch, wire_.direction, 0, rig::Reason::hm2_outputs_off};
  }
  at_rest_ = bitten || !as_set;
  for (std::size_t i = 0; i < 2; ++i) {
    if ((answer.control[i] & quadrature_error) == 0) continue;
    return {IoError::implausible_answer, wire_.control[i], 0, rig::Reason::hm2_quadrature_error};
  }
  return {};
}

std::int64_t Hm2Driver::time_of(const CycleAnswer& answer, std::int64_t sent_ns,
                                std::int64_t received_ns) const noexcept {
  const std::int64_t middle_ns = sent_ns + (received_ns - sent_ns) / 2;
  // The board's clock gives the best interval, but wraps after 65.5 ms. The times of request and answer bound it.
  constexpr std::int64_t wrap_ns = 65'000'000;
  if (!any_answer_ || middle_ns - last_.time_ns > wrap_ns) return middle_ns;
  const auto interval_us = static_cast<std::uint16_t>(answer.clock_us - clock_us_);
  return std::clamp(last_.time_ns + interval_us * rig::ns_per_us, sent_ns, std::max(sent_ns, received_ns));
}

// A stamp wraps after 65,536 ticks. It is unambiguous if less time has passed since the last answer.
std::int32_t Hm2Driver::edge_age_ns(const CycleAnswer& answer, std::size_t wheel, bool moved, std::int64_t since_ns,
                                    std::int32_t before_ns) const noexcept {
  constexpr double wrap_ticks = 65536.0;
  const auto stamp = static_cast<std::uint16_t>(answer.count[wheel] >> 16U);
  const bool same_stamp = stamp == raw_counts_[wheel] >> 16U;
  if (!moved) {
    // The wheel crossed an edge and came back: the stamp does not tell which crossing was the last.
    if (!same_stamp || before_ns < 0) return rig::no_edge_age;
    const std::int64_t age_ns = before_ns + since_ns;
    return age_ns <= std::numeric_limits<std::int32_t>::max() ? static_cast<std::int32_t>(age_ns) : rig::no_edge_age;
  }
  if (same_stamp) return rig::no_edge_age;  // a board without stamps
  if (!any_answer_ || static_cast<double>(since_ns) >= wrap_ticks * stamp_tick_ns_) return rig::no_edge_age;
  const auto ticks = static_cast<std::uint16_t>(answer.stamp_clock - stamp);
  return static_cast<std::int32_t>(std::lround(ticks * stamp_tick_ns_));
}

IoResult Hm2Driver::take_counts(const CycleAnswer& answer, std::int64_t time_ns) noexcept {
  const std::array<std::int32_t, 2> signs{options_.upper_sign, options_.lower_sign};
  std::array<std::int32_t, 2> moved{};
  for (std::size_t wheel = 0; wheel < 2 && any_answer_; ++wheel) {
    moved[wheel] = travelled(raw_counts_[wheel], answer.count[wheel], 16) * signs[wheel];
    if (!plausible_travel(0, moved[wheel], time_ns - last_.time_ns, options_)) {
      return {IoError::implausible_answer, wire_.count[wheel], 0, rig::Reason::hm2_values_implausible};
    }
  }
  last_.upper_counts = counts_after(last_.upper_counts, moved[0]);
  last_.lower_counts = counts_after(last_.lower_counts, moved[1]);
  const std::int64_t since_ns = time_ns - last_.time_ns;
  last_.upper_edge_age_ns = edge_age_ns(answer, 0, moved[0] != 0, since_ns, last_.upper_edge_age_ns);
  last_.lower_edge_age_ns = edge_age_ns(answer, 1, moved[1] != 0, since_ns, last_.lower_edge_age_ns);
  last_.time_ns = time_ns;
  raw_counts_ = answer.count;
  clock_us_ = answer.clock_us;
  any_answer_ = true;
  return {};
}

IoResult Hm2Driver::latch(const IoResult& fault) noexcept {
  if (fault_.ok()) fault_ = fault;
  send_safe();  // at once, because the caller may react late
  return fault;
}

IoResult Hm2Driver::do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  ++counters_.cycles;
  const std::int64_t sent_ns = clock_ns(now_ns);
  if (lock_step_) tell_time(emulated_ns_ + now_ns - activated_ns_);
  if (const int error = link_->send(wire_.read(++read_number_).bytes()); error != 0) last_errno_ = error;
  // Without a clock of its own the emulated time does not advance meanwhile.
  const std::int64_t deadline_ns =
      read_clock_ == nullptr ? monotonic_ns() + rig::ns_per_s : sent_ns + answer_timeout_ns_;
  CycleAnswer answer;
  if (!await_answer(deadline_ns, answer)) {
    measurement = last_;
    const IoResult lost = lost_answer();
    return lost.ok() ? lost : latch(lost);
  }
  const std::int64_t received_ns = clock_ns(sent_ns);
  counters_.answers_ns += received_ns - sent_ns;
  counters_.longest_answer_ns = std::max(counters_.longest_answer_ns, received_ns - sent_ns);
  unanswered_ = false;
  IoResult result = judge(answer);
  if (result.ok()) result = take_counts(answer, time_of(answer, sent_ns, received_ns));
  if (!result.ok()) return latch(result);
  measurement = last_;
  return {};
}

IoResult Hm2Driver::do_write(const rig::Command& command, rig::Command& sent) noexcept {
  if (!in_range(command)) return {IoError::command_out_of_range};
  if (!fault_.ok()) {
    send_safe();
    sent = rig::safe_command;
    return rig::acts(command) ? fault_ : IoResult{};
  }
  sent = command_;
  if (unanswered_) {
    ++counters_.withheld;
    return {};
  }
  const bool sets_up = !driving_ && at_rest_;
  constexpr unsigned value_shift = 16;  // of a PWM's value register
  const rig::Command out = sets_up ? rig::safe_command : grid_.as_sent(command);
  ++write_number_;
  Packet packet;
  if (sets_up) {
    packet = set_up_packet();
    put_outputs_on(packet);
  } else {
    PortWords data{};
    for (unsigned port = 0; port < board_.ports; ++port) {
      data[port] = (out.motor_enable ? pins_.enable[port] : 0) | ((write_number_ & 1U) != 0 ? pins_.relay[port] : 0);
    }
    packet = wire_.write(data, {grid_.motor_width(out) << value_shift, grid_.brake_width(out) << value_shift},
                         write_number_);
  }
  commands_[write_number_ % commands_.size()] = out;
  if (const int error = link_->send(packet.bytes()); error != 0) {
    last_errno_ = error;
    --write_number_;  // the next one has its number
    ++counters_.writes_lost;
    bucket_.lost();
    return bucket_.tripped() ? IoResult{IoError::disconnected, at::write_number, error, rig::Reason::hm2_silent}
                             : IoResult{};
  }
  driving_ = true;
  at_rest_ = false;
  sent = command_ = out;
  return {};
}

bool Hm2Driver::took_other_command(rig::Command& command) const noexcept {
  if (took_other_) command = command_;
  return took_other_;
}

using rig::formatted;

BoardIdentity Hm2Driver::identity() const {
  if (!link_) return {};
  return {.place = board_.mac,
          .logic = formatted("%s, IDROM %s, LBP16 %u, firmware %u", board_.name.c_str(), board_.idrom_name.c_str(),
                             board_.protocol_version, board_.firmware_version)};
}

std::vector<std::string> Hm2Driver::notes() const {
  if (!link_) return {};
  return {formatted("hm2: %s at %s, MAC %s", identity().logic.c_str(), options_.address.c_str(), board_.mac.c_str()),
          formatted("the board drops all outputs %d ms after the last command; ten datagrams lost in a row end the run",
                    options_.watchdog_ms)};
}

std::optional<RigDriver::AnswerTimes> Hm2Driver::answer_times() const {
  const std::uint64_t answers = counters_.cycles - counters_.unanswered;
  return AnswerTimes{.answers = answers,
                     .mean_us = 1e-3 * static_cast<double>(counters_.answers_ns) /
                                static_cast<double>(std::max<std::uint64_t>(answers, 1)),
                     .longest_us = 1e-3 * static_cast<double>(counters_.longest_answer_ns)};
}

std::vector<std::string> Hm2Driver::tally() const {
  using Number = unsigned long long;
  std::vector<std::string> lines;
  lines.push_back(
      formatted("hm2: %llu cycles, %llu without an answer in time; %llu writes lost, %llu withheld until the "
                "board answered again; an answer took %.0f us on average, %.0f us at most",
                static_cast<Number>(counters_.cycles), static_cast<Number>(counters_.unanswered),
                static_cast<Number>(counters_.writes_lost), static_cast<Number>(counters_.withheld),
                answer_times()->mean_us, answer_times()->longest_us));
  if (counters_.not_udp > 0) {
    lines.push_back(
        formatted("hm2: %llu other packets on the wire (ARP, for example); give the board a permanent ARP "
                  "entry and an interface of its own (docs/hm2.md, \"The network\")",
                  static_cast<Number>(counters_.not_udp)));
  }
  if (counters_.stale + counters_.wrong_length > 0) {
    lines.push_back(formatted("hm2 datagrams dropped: %llu late or repeated, %llu of wrong length",
                              static_cast<Number>(counters_.stale), static_cast<Number>(counters_.wrong_length)));
  }
  return lines;
}

std::vector<std::string> Hm2Driver::inspection() {
  if (!link_) return {};
  std::vector<std::string> lines = notes();
  lines.push_back(formatted("clocks %.0f and %.0f MHz, %u ports of %u pins", 1e-6 * board_.clock_low_Hz,
                            1e-6 * board_.clock_high_Hz, board_.ports, board_.port_width));
  lines.insert(lines.end(), board_.modules.begin(), board_.modules.end());
  CycleAnswer answer;
  if (!ask_board(answer)) {
    lines.emplace_back("no answer");
    return lines;
  }
  for (unsigned port = 0; port < board_.ports; ++port) {
    lines.push_back(formatted("port %u: outputs (DDR) 0x%05x", port, answer.direction[port]));
  }
  lines.push_back(formatted("watchdog: %s", (answer.bitten & 1U) != 0 ? "has bitten, outputs off" : "armed"));
  lines.push_back(formatted("encoder inputs: upper wheel 0x%04x, lower wheel 0x%04x", answer.control[0] & 0xFFFFU,
                            answer.control[1] & 0xFFFFU));
  return lines;
}

std::vector<std::string> Hm2Driver::traffic() const { return link_ ? link_->lines() : std::vector<std::string>{}; }

}  // namespace abs_hil::driver::hm2
