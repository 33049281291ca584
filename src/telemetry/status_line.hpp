#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "rig/record_sink.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::telemetry {

/// The text of the status line: phase, speeds, slip, theta estimate, overruns, drops, then wake-up latency and cycle
/// time as p50/p99/p99.9/max. UTF-8, no line end. Ends before the first field that does not fit into `columns`.
[[nodiscard]] std::string format_status_line(const rig::CycleRecord& record, const StatusSnapshot& status,
                                             int columns = std::numeric_limits<int>::max());

/// A status line on a terminal, for runs in real time. It is redrawn at most ten times a second by the records' stamps.
/// It does nothing if the file is not a terminal, and does not wait for a terminal that is held (Ctrl-S).
class StatusLine : public rig::RecordSink {
 public:
  /// `file` is a file descriptor, 2 for stderr; it stays open.
  explicit StatusLine(StatusSource status, int file = 2);
  ~StatusLine() override;

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Erases the line.
  void finish() override { erase(); }
  /// Erases the line for other text on the same terminal. The next record draws it again.
  void erase() noexcept;

  [[nodiscard]] bool active() const noexcept { return active_; }

 private:
  void put(std::string_view text) noexcept;

  StatusSource status_;
  int file_;
  bool active_;
  bool drawn_{false};
  std::optional<std::int64_t> next_draw_ns_;
};

}  // namespace abs_hil::telemetry
