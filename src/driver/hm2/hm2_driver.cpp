// The driver's lifecycle: finding its pins, setting the outputs up, making them safe. Its entry in the registry.

#include "driver/hm2/hm2_driver.hpp"

#include <arpa/inet.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

using rig::formatted;

namespace {

constexpr std::uint32_t pwm_steps = 4096;
constexpr double answer_share = 0.8;  // of the period
constexpr std::uint32_t unbuffered_12_bit = 0x03;
constexpr std::uint32_t count_filter = 0x0800;  // 15 clocks instead of 3
constexpr std::uint32_t stamps_at_2_MHz = 48;   // at 100 MHz: the clock / (48 + 2)
/// Of a counter's lines: the clock / (n + 2) is 25 MHz at 100 MHz. What multiplexes them takes longer: 8 MHz.
std::uint32_t filter_of(const Board& board) {
  constexpr double muxed_Hz = 8e6;
  constexpr double usual = 2.0;
  return static_cast<std::uint32_t>(board.multiplexed ? std::max(0.0, board.counter.clock_Hz / muxed_Hz - 2.0) : usual);
}
/// Register 1 of the ports at base 0x1000, in all firmware known to us.
constexpr std::uint16_t usual_direction = 0x1100;

std::uint32_t pwm_rate(const Hm2Options& options, const Board& board) {
  constexpr double rate_steps = 65536.0;
  return static_cast<std::uint32_t>(options.pwm_frequency_Hz * rate_steps * pwm_steps / board.pwm.clock_Hz);
}

/// The watchdog bites (time + 1) clocks after its last pet.
std::uint32_t watchdog_time(const Hm2Options& options, const Board& board) {
  return static_cast<std::uint32_t>(std::llround(1e-3 * options.watchdog_ms * board.watchdog.clock_Hz)) - 1;
}

OpenLink opener(const Hm2Options& options) {
  return [address = parse_address(options.address)] { return std::make_unique<UdpLink>(address); };
}

/// This computer's own address is an emulator's, which has to show its mark.
BoardReality reality(const Hm2Options& options) {
  constexpr std::uint32_t loopback = 127;
  const std::uint32_t address = ntohl(parse_address(options.address).sin_addr.s_addr);
  return {.reality = address >> 24U == loopback ? Reality::emulator : Reality::unknown};
}

std::unique_ptr<RigDriver> make_driver(const Hm2Options& options, const RunFacts& run) {
  Hm2Options hm2 = options;
  hm2.encoder_counts_per_rev = run.encoder_counts_per_rev;
  hm2.rate_Hz = run.rate_Hz;
  const bool must_be_marked = run.emulated || reality(options).reality == Reality::emulator;
  return std::make_unique<Hm2Driver>(hm2, opener(hm2), monotonic_ns, run.lock_step, must_be_marked);
}

std::unique_ptr<SafeStateWriter> make_writer(const Hm2Options& options, const RunFacts& /*run*/) {
  return safe_state_writer(options, opener(options));
}

void check(const Hm2Options& options, const RunFacts& run) {
  static_cast<void>(parse_address(options.address));
  constexpr double least_cycles = 3.0;  // a board that misses one write must not bite
  if (run.lock_step || options.watchdog_ms * run.rate_Hz >= least_cycles * 1e3) return;
  throw std::invalid_argument(
      formatted("driver.hm2.watchdog_ms = %d: the board needs three commands in this time; raise "
                "control.rate_Hz to %.0f, or the watchdog's time to at most 20 ms",
                options.watchdog_ms, least_cycles * 1e3 / options.watchdog_ms));
}

}  // namespace

OutputGrid output_grid(const Hm2Options& options) noexcept {
  constexpr double largest = (pwm_steps - 1.0) / pwm_steps;
  return {.duty_steps = pwm_steps,
          .motor_duty_max = std::min(options.motor_duty_max, largest),
          .brake_duty_max = std::min(options.brake_duty_max, largest)};
}

Packet safe_packet(const Board& board, const RegisterPair& pwm) noexcept {
  Packet packet;
  write_pair(packet, pwm, {0, 0});
  packet.write32(board.pwm.address(reg::enable), 0);
  packet.write32(board.watchdog.address(reg::time), 1);
  return packet;
}

Hm2Driver::Hm2Driver(const Hm2Options& options, OpenLink open_link, ReadClock read_clock, bool lock_step,
                     bool must_be_marked)
    : BoardDriver(output_grid(options), lock_step ? nullptr : read_clock),
      options_(options),
      open_link_(std::move(open_link)),
      lock_step_(lock_step),
      must_be_marked_(must_be_marked),
      answer_timeout_ns_(answer_timeout_ns("driver.hm2.", options, answer_share)) {
  check_options("driver.hm2.", options);
}

void Hm2Driver::do_configure() {
  link_.reset();
  link_ = std::make_unique<RecordedLink>(open_link_());
  read_number_ = static_cast<std::uint32_t>(monotonic_ns()) ^ static_cast<std::uint32_t>(::getpid()) << 16U;
  const bool was_on = outputs_at_usual_place();
  board_ = read_board(*link_, options_.address, read_number_);
  if (must_be_marked_ && mark() == Mark::none) {
    throw std::invalid_argument(
        "driver.hm2.address = " + options_.address +
        ": this board carries no emulator's mark, so it counts as a real one; remove driver.emulated, and give it an "
        "address of a network of its own (docs/hm2.md)");
  }
  if (lock_step_) require_lock_step("the hm2 board at " + options_.address, true, waits_for_time());
  pins_ = find_pins(board_, options_);
  const std::uint32_t rate = pwm_rate(options_, board_);
  constexpr std::uint32_t most_rate = 65535;
  if (rate < 1 || rate > most_rate) {
    refuse(formatted("driver.hm2.pwm_frequency_Hz = %g: with its clock of %.0f Hz the board makes %.1f to %.0f Hz",
                     options_.pwm_frequency_Hz, board_.pwm.clock_Hz, board_.pwm.clock_Hz / 65536.0 / pwm_steps,
                     board_.pwm.clock_Hz / pwm_steps));
  }
  const auto pair = [](const Module& module, unsigned of, std::int32_t first, std::int32_t second) {
    return RegisterPair{module.address(of, static_cast<unsigned>(first)),
                        module.address(of, static_cast<unsigned>(second))};
  };
  wire_ = {.ports = board_.ports,
           .port_data = board_.port.address(reg::data),
           .direction = board_.port.address(reg::direction),
           .bitten = board_.watchdog.address(reg::bitten),
           .pet = board_.watchdog.address(reg::pet),
           .stamp_clock = board_.counter.address(reg::stamp_clock),
           .count = pair(board_.counter, reg::count, options_.upper_channel, options_.lower_channel),
           .control = pair(board_.counter, reg::control, options_.upper_channel, options_.lower_channel),
           .pwm = pair(board_.pwm, reg::value, options_.drive_pwm, options_.brake_pwm)};
  stamp_tick_ns_ = (stamps_at_2_MHz + 2) * static_cast<double>(rig::ns_per_s) / board_.counter.clock_Hz;
  CycleAnswer answer;
  if (!ask_board(answer)) refuse("the hm2 board went silent");
  if (!all_off(answer.direction) || (was_on && wire_.direction == usual_direction)) {
    refuse("outputs of the hm2 board at " + options_.address +
           " are on (its DDR is not 0): another program drives it. End that one, or make the board safe with abs_hil "
           "safe --set driver.kind=hm2");
  }
}

/// A program that drives the board ends its outputs once it notices another one. So the first datagram looks at them.
bool Hm2Driver::outputs_at_usual_place() noexcept {
  constexpr unsigned ports = 2;
  Packet packet;
  const std::size_t where = packet.read(space::hostmot2, usual_direction, ports);
  std::array<std::uint8_t, 4 * ports> answer{};
  return ask(*link_, packet, answer, read_number_) && (word32(answer, where) | word32(answer, where + 4)) != 0;
}

Hm2Driver::Mark Hm2Driver::mark() {
  constexpr std::uint16_t cookie = 0x5A00 | space::emulator;
  Packet packet;
  const std::size_t at = packet.read(space::info | space::emulator, 0, 2);
  std::array<std::uint8_t, 4> answer{};
  if (!ask(*link_, packet, answer, read_number_) || word16(answer, at) != cookie) return Mark::none;
  return word16(answer, at + 2) != 0 ? Mark::lock_step : Mark::real_time;  // the sizes that the space takes
}

bool Hm2Driver::waits_for_time() {
  if (mark() != Mark::lock_step) return false;
  Packet time;
  time.read(space::emulator, 0, 2);
  std::array<std::uint8_t, 8> ns{};
  if (!ask(*link_, time, ns, read_number_)) return false;
  emulated_ns_ = told_ns_ = static_cast<std::int64_t>(word32(ns, 0) | std::uint64_t{word32(ns, 4)} << 32U);
  return true;
}

bool Hm2Driver::all_off(const PortWords& direction) const noexcept {
  return std::ranges::all_of(of_ports(direction, board_), [](std::uint32_t bits) { return bits == 0; });
}

bool Hm2Driver::ask_board(CycleAnswer& answer, int tries) noexcept {
  for (int attempt = 0; attempt < tries; ++attempt) {
    if (link_->send(wire_.read(++read_number_).bytes()) != 0) continue;
    if (await_answer(monotonic_ns() + safe_answer_ns, answer)) return true;
  }
  return false;
}

// The order keeps the old PWM values, which the board holds over a bite, from the pins: direction comes last.
Packet Hm2Driver::set_up_packet() const noexcept {
  const auto pwm_mode = RegisterPair{board_.pwm.address(reg::mode, static_cast<unsigned>(options_.drive_pwm)),
                                     board_.pwm.address(reg::mode, static_cast<unsigned>(options_.brake_pwm))};
  const std::uint32_t both =
      1U << static_cast<unsigned>(options_.drive_pwm) | 1U << static_cast<unsigned>(options_.brake_pwm);
  constexpr PortWords none{};
  Packet packet;
  write_pair(packet, wire_.pwm, {0, 0});
  write_pair(packet, pwm_mode, {unbuffered_12_bit, unbuffered_12_bit});
  packet.write32(board_.pwm.address(reg::rate), pwm_rate(options_, board_));
  packet.write32(board_.pwm.address(reg::enable), both);
  packet.write32(board_.port.address(reg::invert), of_ports(pins_.inverted, board_));
  packet.write32(board_.port.address(reg::open_drain), of_ports(none, board_));
  packet.write32(board_.port.address(reg::alternate_source), of_ports(pins_.modules, board_));
  packet.write32(wire_.port_data, of_ports(none, board_));
  write_pair(packet, wire_.control, {count_filter, count_filter});
  packet.write32(board_.counter.address(reg::stamp_divisor), stamps_at_2_MHz);
  packet.write32(board_.counter.address(reg::filter), filter_of(board_));
  packet.write32(board_.watchdog.address(reg::time), watchdog_time(options_, board_));
  packet.write32(wire_.bitten, 0);
  packet.write_number(at::write_number, write_number_);
  return packet;
}

void Hm2Driver::put_outputs_on(Packet& packet) const noexcept {
  packet.write32(wire_.direction, of_ports(pins_.outputs, board_));
  packet.write_number(at::write_number, write_number_);
}

bool Hm2Driver::set_up_outputs(std::string& why) {
  CycleAnswer answer;
  const auto shown = [&] {
    if (ask_board(answer)) return true;
    why = "the board does not answer";
    return false;
  };
  if (!shown()) return false;
  if (!all_off(answer.direction)) {
    why = "its outputs are on (DDR is not 0): another program drives it";
    return false;
  }
  const Received before = answer.received;
  ++write_number_;
  static_cast<void>(link_->send(set_up_packet().bytes()));
  if (!shown()) return false;
  counts_udp_ = answer.received.udp != before.udp;
  if (answer.write_number != write_number_ || answer.bitten != 0) {
    why = answer.bitten != 0 ? "its watchdog bit while it was set up" : "it did not take what was written";
    return false;
  }
  for (const std::uint32_t control : answer.control) {
    if ((control & quadrature_error) == 0) continue;
    why = "a counter reports a quadrature error that does not clear: check its encoder and cable, power the board anew";
    return false;
  }
  Packet on;
  on.write32(wire_.pet, reload);
  ++write_number_;
  put_outputs_on(on);
  static_cast<void>(link_->send(on.bytes()));
  if (!shown()) return false;
  why = "its watchdog or another program switched them off at once, or it did not take what was written";
  return answer.write_number == write_number_ && answer.bitten == 0 &&
         std::ranges::equal(of_ports(answer.direction, board_), of_ports(pins_.outputs, board_));
}

void Hm2Driver::do_activate(std::int64_t now_ns) {
  fault_ = {};
  driving_ = at_rest_ = unanswered_ = took_other_ = any_answer_ = false;
  missing_ = 0;
  command_ = {};
  bucket_.reset();
  counters_ = {};
  last_ = {};
  last_.time_ns = now_ns;
  last_errno_ = 0;
  activated_ns_ = now_ns;
  if (lock_step_) static_cast<void>(waits_for_time());
  // No other program's numbers are likely to be near this one.
  write_number_ = first_write_ = static_cast<std::uint32_t>(monotonic_ns() >> 8U) ^ 0x5EED0000U;
  constexpr int tries = 5;  // a slow computer may miss the watchdog's time between two datagrams
  std::string why;
  for (int attempt = 0; attempt < tries; ++attempt) {
    if (set_up_outputs(why)) {
      first_write_ = write_number_;
      commands_[write_number_ % commands_.size()] = rig::safe_command;
      return;
    }
    send_safe();
  }
  refuse("the hm2 board at " + options_.address + " could not be activated; it was made safe again: " + why);
}

void Hm2Driver::send_safe() noexcept {
  command_ = rig::safe_command;
  static_cast<void>(link_->send(safe_packet(board_, wire_.pwm).bytes()));
  constexpr std::int64_t bite_takes_ns = 1000;
  if (lock_step_) tell_time(told_ns_ + bite_takes_ns);
}

void Hm2Driver::tell_time(std::int64_t time_ns) noexcept {
  told_ns_ = std::max(told_ns_, time_ns);
  Packet time;
  time.write_time(static_cast<std::uint64_t>(told_ns_));
  static_cast<void>(link_->send(time.bytes()));
}

IoResult Hm2Driver::do_make_safe() noexcept {
  if (!link_) return {IoError::disconnected};
  CycleAnswer answer;
  bool answered = false;
  for (int attempt = 0; attempt < safe_tries; ++attempt) {
    send_safe();
    answered = ask_board(answer, 1);
    if (answered && all_off(answer.direction)) return {};
  }
  return answered ? IoResult{IoError::read_back_mismatch, wire_.direction} : silent(wire_.direction);
}

IoResult Hm2Driver::do_rest() noexcept {
  const IoResult result = do_make_safe();
  driving_ = false;
  at_rest_ = true;
  return result;
}

bool Hm2Driver::outputs_now(rig::Command& applied) noexcept {
  CycleAnswer answer;
  if (!link_ || !ask_board(answer)) return false;
  applied = all_off(answer.direction) ? rig::safe_command : commands_[answer.write_number % commands_.size()];
  return true;
}

Backend hm2_backend() {
  return backend<Hm2Options>({
      .name = "hm2",
      .summary = "HostMot2 board over Ethernet, Mesa 7I92T and kin (docs/hm2.md); unverified on hardware",
      .not_verified =
          "The protocol was read from others' sources and has been tested only with emulators. Do the checks of "
          "docs/hm2.md, \"What is not verified\", with abs_hil commission",
      .make_driver = make_driver,
      .make_safe_state_writer = make_writer,
      .outputs = output_grid,
      .reality = reality,
      .inspect = inspect,
      .check = check,
      .udp_peer =
          [](const Hm2Options& options) {
            const sockaddr_in peer = parse_address(options.address);
            return formatted("%08X:%04X", peer.sin_addr.s_addr, static_cast<unsigned>(ntohs(peer.sin_port)));
          },
      .free_options = {"address", "answer_timeout_us", "plausible_speed_rad_s"},
  });
}

}  // namespace abs_hil::driver::hm2
