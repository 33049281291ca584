#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "abs_hil/rig/cycle_record.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::telemetry {

/// Values of event_t.kind.
namespace event_kind {
inline constexpr std::string_view phase = "phase";
inline constexpr std::string_view fault = "fault";
inline constexpr std::string_view limit = "limit";
inline constexpr std::string_view command = "command";
}  // namespace event_kind

/// An event that a record caused.
struct DetectedEvent {
  std::string_view kind;
  std::string message;  ///< for people, one line
  std::string reason;   ///< the record's reason in words
};

/// Finds events in the stream of records, so that the real-time thread handles numbers only. Each change of phase and
/// each new reason gives one event, even if records repeat it or are missing.
class EventDetector {
 public:
  explicit EventDetector(rig::RunNames names = {}) : names_(std::move(names)) {}

  /// Takes every record, in order. The first always gives an event.
  [[nodiscard]] std::optional<DetectedEvent> observe(const rig::CycleRecord& record);

 private:
  struct Seen {
    std::uint64_t sequence;
    rig::Phase phase;
    std::uint16_t phase_index;
    rig::Reason reason;
  };
  rig::RunNames names_;
  std::optional<Seen> last_;
  std::string phase_name_;  ///< of the latest record
};

}  // namespace abs_hil::telemetry
