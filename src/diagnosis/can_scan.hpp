#pragma once

#include <string>
#include <vector>

#include "diagnosis/finding.hpp"
#include "driver/can/interface_facts.hpp"

namespace abs_hil::diagnosis {

/// Whether this kernel supports CAN sockets (PF_CAN, raw).
[[nodiscard]] bool has_can_sockets() noexcept;

/// Findings of the check "can": each interface with its state, its bit rate and the load of a run at `rate_Hz`. A
/// missing interface, or missing kernel support, is a note. The load of a vcan interface is meaningless.
[[nodiscard]] std::vector<Finding> judge(const std::vector<driver::can::InterfaceFacts>& interfaces, bool can_sockets,
                                         double rate_Hz);

/// The load at `rate_Hz` on a bus of 1 Mbit/s and with CAN FD, for a computer without an interface.
[[nodiscard]] Finding bus_load_finding(double rate_Hz);

}  // namespace abs_hil::diagnosis
