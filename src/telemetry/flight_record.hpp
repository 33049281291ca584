#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/reason.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::telemetry {

/// The contents of a flight recorder at a fault, and the reason.
struct FlightRecord {
  std::span<const rig::CycleRecord> records;  ///< in order
  rig::Reason reason{rig::Reason::none};
  double reason_value{0.0};
  std::string account{};  ///< in words, several lines: what happened and what the program did
};

/// The columns of the recorder's CSV beyond those of a run's.
inline constexpr std::string_view flight_csv_extra_header =
    ",cycle,stamp_ns,supply_V,temperature_C,trip_flags,reason,reason_value,wakeup_latency_us,cycle_us";

/// Writes `PREFIX.csv` (a row a cycle, `distance_m` NaN, with more columns than a run's CSV, the controller's own
/// signals last), `PREFIX.lcmlog` (the messages of a run, then an ABS_EVENT of kind "fault" with the reason) and
/// `PREFIX.txt` (reason and account). Beside an older record they are called `PREFIX-2`, and so on. A failure of one
/// file does not stop the others. Returns the written files. Appends the problems to `problems`.
std::vector<std::filesystem::path> write_flight_record(const std::filesystem::path& prefix, const FlightRecord& record,
                                                       const ExperimentInfo& experiment,
                                                       const std::string& channel_prefix,
                                                       std::vector<std::string>& problems);

}  // namespace abs_hil::telemetry
