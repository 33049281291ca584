#include "driver/can/can_backend.hpp"

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include "driver/can/bus.hpp"
#include "driver/can/can_driver.hpp"
#include "driver/can/can_safe_state.hpp"
#include "driver/can/interface_facts.hpp"
#include "driver/own_handle_writer.hpp"

namespace abs_hil::driver::can {

namespace {

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
  return std::make_unique<CanSafeState>(
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

}  // namespace abs_hil::driver::can
