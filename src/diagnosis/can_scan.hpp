#pragma once

#include <string>
#include <vector>

#include "diagnosis/finding.hpp"
#include "driver/can/interface_facts.hpp"

namespace abs_hil::diagnosis {

/// Whether this kernel makes CAN sockets (PF_CAN, raw).
[[nodiscard]] bool has_can_sockets() noexcept;

/// Findings of the check "can": each interface with state, bit rate and the load that a run at `rate_Hz` would put on
/// it. No interface, or none in the kernel, is a note. A vcan interface says nothing of a bus.
[[nodiscard]] std::vector<Finding> judge(const std::vector<driver::can::InterfaceFacts>& interfaces, bool can_sockets,
                                         double rate_Hz);

/// The load on a bus of 1 Mbit/s, and with CAN FD, at `rate_Hz`: for who has no interface yet.
[[nodiscard]] Finding bus_load_finding(double rate_Hz);

}  // namespace abs_hil::diagnosis
