#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "rig/record_sink.hpp"
#include "telemetry/status_snapshot.hpp"

namespace abs_hil::telemetry {

/// The text of the status line: phase, speeds, slip, theta estimate, overruns, drops, then wake-up latency and cycle
/// time as p50/p99/p99.9/max. UTF-8, no line end.
[[nodiscard]] std::string format_status_line(const rig::CycleRecord& record, const StatusSnapshot& status);

/// `text` cut to `columns` of a terminal; combining marks take none.
[[nodiscard]] std::string_view cut_to_columns(std::string_view text, int columns) noexcept;

/// A line on a terminal, drawn over itself at most ten times a second by the records' stamps; for runs in real time.
/// Does nothing where the file is not a terminal, and skips a terminal that is held (Ctrl-S) rather than wait for it.
class StatusLine : public rig::RecordSink {
 public:
  /// `file` is a file descriptor, 2 for stderr; it stays open.
  explicit StatusLine(StatusSource status, int file = 2);
  ~StatusLine() override;

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Erases the line.
  void finish() override { erase(); }
  /// Makes room for other text on the same terminal; the next record draws the line again.
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
