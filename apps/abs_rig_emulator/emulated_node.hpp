#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus_socket.hpp"
#include "emulator/can_node.hpp"
#include "emulator/can_node_faults.hpp"

namespace abs_hil::program {

/// The CAN I/O node on its bus: time, faults, log and the control commands.
class EmulatedNode {
 public:
  /// Throws std::invalid_argument.
  EmulatedNode(const emulator::CanNodeOptions& options, std::uint64_t seed);

  /// Advances the rig to the current time; in lock-step only ABS_TIME advances it.
  void catch_up();
  /// Answers all received frames.
  void serve(BusSocket& bus);
  /// Obeys one control command and returns its answer. Throws std::invalid_argument for an unknown command.
  std::string obey(std::string_view line);
  /// The commands of `obey`, one per line.
  [[nodiscard]] static const char* commands();
  /// Current duties at the power stage and other values, as one line.
  [[nodiscard]] std::string status() const;

 private:
  void log_events();
  void power_on();

  emulator::CanNodeOptions options_;
  emulator::CanNode node_;
  emulator::NodeFaults faults_;
  std::int64_t started_ns_{0};
};

}  // namespace abs_hil::program
