#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"

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
  /// @param own_signals  names of the controller's own signals, for the reasons' texts
  explicit EventDetector(std::vector<std::string> own_signals = {}) : own_signals_(std::move(own_signals)) {}
  /// Takes every record, in order. The first always gives an event.
  [[nodiscard]] std::optional<DetectedEvent> observe(const rig::CycleRecord& record);

 private:
  struct Seen {
    std::uint64_t sequence;
    rig::Phase phase;
    std::uint16_t phase_index;
    rig::Reason reason;
  };
  std::vector<std::string> own_signals_;
  std::optional<Seen> last_;
};

}  // namespace abs_hil::telemetry
