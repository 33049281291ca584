// The registry's entry for driver.kind=hm2, and what the driver tells people.

#include <arpa/inet.h>

#include <algorithm>
#include <stdexcept>

#include "driver/hm2/hm2_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

using rig::formatted;

namespace {

OpenLink opener(const Hm2Options& options) {
  return [address = parse_address(options.address)] { return std::make_unique<UdpLink>(address); };
}

std::unique_ptr<RigDriver> make_driver(const Hm2Options& options, const RunFacts& run) {
  Hm2Options hm2 = options;
  hm2.encoder_counts_per_rev = run.encoder_counts_per_rev;
  hm2.rate_Hz = run.rate_Hz;
  return std::make_unique<Hm2Driver>(hm2, opener(hm2), monotonic_ns, run.lock_step);
}

std::unique_ptr<SafeStateWriter> make_writer(const Hm2Options& options, const RunFacts& /*run*/) {
  return safe_state_writer(options, opener(options));
}

/// Nothing but an emulator answers at this computer's own address.
BoardReality reality(const Hm2Options& options) {
  constexpr std::uint32_t loopback = 127;
  const std::uint32_t address = ntohl(parse_address(options.address).sin_addr.s_addr);
  return {.reality = address >> 24U == loopback ? Reality::emulator : Reality::unknown};
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
      .check = check,
      .free_options = {"address", "answer_timeout_us", "plausible_speed_rad_s"},
  });
}

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
