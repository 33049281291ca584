#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::experiment::test {

// Checks that a run's files are complete. Each check returns the problem as text; empty if there is none.

/// A run's CSV: the header, a complete row for every cycle, and a last row with the run's last phase and time.
[[nodiscard]] std::string fault_of_csv(const std::filesystem::path& csv, const std::vector<rig::CycleRecord>& records);

/// The flight recorder: the last cycles of the run without a gap, the last one with its reason; and the three files
/// written from it to PREFIX.
[[nodiscard]] std::string fault_of_recorder(const runtime::FlightRing& recorder, std::size_t slots,
                                            const std::vector<rig::CycleRecord>& records,
                                            const std::filesystem::path& prefix);

}  // namespace abs_hil::experiment::test
