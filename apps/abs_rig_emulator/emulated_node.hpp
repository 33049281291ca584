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

  /// Lets the rig go on to the wall clock; in lock-step it waits for ABS_TIME.
  void catch_up();
  /// Answers all frames that have come.
  void serve(BusSocket& bus);
  /// One control command; returns its answer. Throws std::invalid_argument for what it does not know.
  std::string obey(std::string_view line);
  /// The commands `obey` knows, one a line.
  [[nodiscard]] static const char* commands();
  /// Duties on the wire now, one line.
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
