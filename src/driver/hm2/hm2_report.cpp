// What the driver tells people of its board and of a run.
#include <algorithm>

#include "driver/hm2/hm2_driver.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::hm2 {

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
