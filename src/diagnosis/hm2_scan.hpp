#pragma once

#include <vector>

#include "diagnosis/finding.hpp"
#include "driver/hm2/hm2_driver.hpp"

namespace abs_hil::diagnosis {

/// Findings of the check "hm2": the interface that leads to the board, its ARP entry and coalescing, round trips, and
/// whether somebody else talks to the board. Reads only.
[[nodiscard]] std::vector<Finding> scan_hm2(const driver::hm2::Hm2Options& options);

/// One in `times_us` for each answer; `asked` requests. `foreign`: packets that others sent meanwhile.
[[nodiscard]] Finding judge_round_trips(std::vector<double> times_us, int asked, int foreign);

/// What the kernel's ARP table, as text, has for the address.
[[nodiscard]] Finding judge_arp(const std::string& table, const std::string& address, const std::string& interface);

}  // namespace abs_hil::diagnosis
