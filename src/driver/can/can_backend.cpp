// The registry's entry for driver.kind=can, and what the driver tells people.

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "driver/can/can_driver.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/own_handle_writer.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::can {

namespace {

using rig::formatted;

std::unique_ptr<RigDriver> make_can_driver(const CanOptions& options, const RunFacts& run) {
  CanOptions can = options;
  can.encoder_counts_per_rev = run.encoder_counts_per_rev;
  can.rate_Hz = run.rate_Hz;
  return std::make_unique<CanDriver>(
      can, [can] { return open_link(can); }, run.lock_step);
}

std::unique_ptr<SafeStateWriter> make_can_writer(const CanOptions& options, const RunFacts& /*run*/) {
  const std::string prefix(unix_prefix);
  const bool socket = options.interface.starts_with(prefix);
  const std::string file = socket ? options.interface.substr(prefix.size()) : "/sys/class/net/" + options.interface;
  return safe_state_writer(
      [options, again = Reopening{file}]() mutable { return again.due() ? open_link(options, false) : Link{}; },
      socket);
}

bool is_virtual(const std::string& interface) {
  try {
    const std::optional<InterfaceFacts> facts = find_interface(interface);
    return facts && (facts->kind == "vcan" || facts->kind == "vxcan");
  } catch (const Unavailable&) {
    return false;
  }
}

/// A network interface with a device behind it is an adapter, and a serial line may have an adapter behind it as well.
/// Only vcan, vxcan and a socket in place of a bus are known to have none.
BoardReality can_reality(const CanOptions& options) {
  if (options.interface.starts_with(unix_prefix)) return {.reality = Reality::emulator};
  std::error_code ignored;
  if (std::filesystem::exists("/sys/class/net/" + options.interface + "/device", ignored)) {
    return {.reality = Reality::hardware,
            .option = "driver.can.interface = " + options.interface,
            .is = "is an adapter to a real bus; give a vcan interface or an emulator's socket"};
  }
  return {.reality = is_virtual(options.interface) ? Reality::emulator : Reality::unknown};
}

/// The node's watchdog is what ends its outputs if this computer dies.
void refuse_long_watchdog(const CanOptions& options, const RunFacts& run) {
  constexpr std::int32_t longest_ms = 50;
  if (!run.hardware || run.outputs_on_after_death || options.watchdog_ms <= longest_ms) return;
  throw std::invalid_argument("driver.can.watchdog_ms = " + std::to_string(options.watchdog_ms) +
                              ": motor and brake would stay on for so long after this computer's death; give at most " +
                              std::to_string(longest_ms) +
                              " ms, or accept the risk with --set unsafe.outputs_on_after_death=true");
}

std::string load_text(double rate_Hz, double bit_rate, double data_bit_rate, bool fd) {
  const BusLoad load = bus_load(rate_Hz, bit_rate, data_bit_rate, fd);
  return formatted("bus load at most %.1f %% at %.0f cycles a second and %.0f bit/s; answer within %.0f us of the SYNC",
                   100.0 * load.share, rate_Hz, bit_rate, 1e6 * load.answer_s);
}

}  // namespace

Backend can_backend() {
  return backend<CanOptions>({
      .name = "can",
      .summary = "CAN I/O node of this project's own protocol (docs/can.md); unverified on hardware",
      .not_verified =
          "The protocol is this project's own (docs/can.md) and has been tested only with an emulated node. Do the "
          "checks of docs/can.md, \"What is not verified\"",
      .make_driver = make_can_driver,
      .make_safe_state_writer = make_can_writer,
      .outputs = output_grid,
      .reality = can_reality,
      .check = refuse_long_watchdog,
      .free_options = {"interface", "fd", "answer_timeout_us", "loss_cost", "loss_relief", "loss_limit",
                       "plausible_speed_rad_s"},
  });
}

std::vector<std::string> CanDriver::notes() const {
  if (!link_.socket) return {};
  std::vector<std::string> notes;
  notes.push_back(formatted(
      "%s: node with protocol %u answers%s; %s frames", link_.place.c_str(), static_cast<unsigned>(identity_.protocol),
      (identity_.features & feature::lock_step) != 0 ? ", an emulator in lock-step" : "", fd_ ? "CAN FD" : "classic"));
  if (const auto& facts = link_.facts; facts && facts->bit_rate > 0) {
    notes.push_back(load_text(options_.rate_Hz, static_cast<double>(facts->bit_rate),
                              static_cast<double>(facts->data_bit_rate), fd_));
  } else {
    constexpr double megabit = 1e6;
    notes.push_back("the interface has no bit rate; on a real bus: " +
                    load_text(options_.rate_Hz, megabit, fd_ ? 5 * megabit : 0.0, fd_));
  }
  notes.push_back(
      formatted("the node zeroes its outputs %d ms after the last valid command; each loss adds %d points, each good "
                "answer takes off %d, and the run ends at %d points",
                options_.watchdog_ms, options_.loss_cost, options_.loss_relief, options_.loss_limit));
  return notes;
}

std::vector<std::string> CanDriver::tally() const {
  const CanCounters& c = counters_;
  const auto counts = [](std::initializer_list<std::pair<std::uint64_t, const char*>> all) {
    std::string text;
    for (const auto& [count, what] : all) text += (text.empty() ? "" : ", ") + std::to_string(count) + what;
    return text;
  };
  std::vector<std::string> lines{
      "CAN: " + counts({{c.cycles, " cycles"}, {c.lost, " without an answer in time"}}) +
      formatted("; longest answer %.0f us", static_cast<double>(c.longest_answer_ns) * 1e-3)};
  const std::uint64_t odd = c.stale + c.duplicates + c.out_of_order + c.wrong_length + c.forged + c.implausible +
                            c.queue_full + c.error_frames + c.dropped_by_kernel + c.rejected_by_node;
  if (odd == 0) return lines;
  lines.push_back("CAN frames: " + counts({{c.stale, " stale"},
                                           {c.duplicates, " duplicate"},
                                           {c.out_of_order, " out of order"},
                                           {c.wrong_length, " of wrong length"},
                                           {c.forged, " forged"},
                                           {c.implausible, " implausible"},
                                           {c.dropped_by_kernel, " dropped by the kernel"}}));
  lines.push_back("CAN bus: " + counts({{c.queue_full, " times the send queue was full"},
                                        {c.error_frames, " error frames"},
                                        {c.error_warnings, " of them warnings"},
                                        {c.rejected_by_node, " commands rejected by the node"}}));
  return lines;
}

std::vector<std::string> CanDriver::inspection() {
  if (!link_.socket) return {};
  std::vector<std::string> lines = notes();
  link_.socket->drain();
  tracker_.reset(sync_);
  // An inactive node answers a SYNC, too, and the SYNC moves nothing.
  tracker_.expect(++sync_);
  static_cast<void>(link_.socket->send(frame_of(id::sync, {.sequence = sync_})));
  sent_ns_ = monotonic_ns();
  static_cast<void>(collect());
  if (!tracker_.complete()) {
    lines.emplace_back("no answer to a SYNC");
    return lines;
  }
  const Values& answer = tracker_.answer().values;
  lines.push_back(formatted("counters: upper wheel %d, lower wheel %d, lever %d", static_cast<int>(answer.upper_counts),
                            static_cast<int>(answer.lower_counts), static_cast<int>(answer.lever_counts)));
  lines.push_back(formatted("node's clock %.6f s, state %s", 1e-6 * static_cast<double>(answer.node_time_us),
                            answer.state() == NodeState::inactive ? "inactive"
                            : answer.state() == NodeState::active ? "active"
                                                                  : "latched"));
  lines.push_back(formatted("supply %.2f V, temperature %.1f deg C, trip flags 0x%x (NaN: not received yet)", supply_V_,
                            temperature_C_, trip_flags_));
  return lines;
}

}  // namespace abs_hil::driver::can
