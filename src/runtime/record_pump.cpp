// Takes records out of the ring, adds the braking distance, and hands them to the sinks.
#include "runtime/record_pump.hpp"

#include <fmt/format.h>

#include <exception>
#include <utility>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

RecordPump::RecordPump(RecordRing& ring, double r2_m, std::vector<rig::RecordSink*> sinks)
    : ring_(ring), r2_m_(r2_m), sinks_(std::move(sinks)) {}

std::size_t RecordPump::drain(std::size_t at_most) {
  std::size_t count = 0;
  while (count < at_most && ring_.pop(latest_)) {
    distance_.note(latest_.time_s, r2_m_ * rig::best_speeds(latest_).omega2_rad_s, latest_.phase == rig::Phase::brake);
    for (rig::RecordSink* sink : sinks_) sink->consume(latest_, distance_.distance_m());
    ++count;
  }
  return count;
}

void RecordPump::finish() {
  std::exception_ptr first;
  const auto keep_first = [&first](auto&& action) {
    try {
      action();
    } catch (...) {
      if (!first) first = std::current_exception();
    }
  };
  keep_first([this] { drain(); });
  for (rig::RecordSink* sink : sinks_) keep_first([sink] { sink->finish(); });
  if (first) std::rethrow_exception(first);
}

void OverrunReporter::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  // The next record tells what a cycle missed. If a record was dropped, the late cycle's own times are lost.
  if (record.timing.periods_skipped > 0 && record.sequence == latest_.sequence + 1) {
    late_ = latest_;
    late_->timing.record_ns = record.timing.record_ns;
    late_->timing.periods_skipped = record.timing.periods_skipped;
    late_->timing.overrun_cause = record.timing.overrun_cause;
  }
  latest_ = record;
}

std::optional<std::string> OverrunReporter::message(const rig::OverrunCounts& counts) {
  if (counts.total <= told_ || !late_) return std::nullopt;
  if (next_message_ns_ && latest_.stamp_ns < *next_message_ns_) return std::nullopt;
  next_message_ns_ = latest_.stamp_ns + rig::ns_per_s;

  using rig::OverrunCause;
  const rig::CycleTiming& late = late_->timing;
  std::string text = fmt::format(
      "{} late cycles ({} new; wakeup {}, read {}, control {}, write {}, record {}), {} ticks missed; the latest at "
      "{:.3f} s missed {} because of {}: period {:.0f} us, woke {:.0f} us late, read {:.0f}, control {:.0f}, write "
      "{:.0f}, record {:.0f} us",
      counts.total, counts.total - told_, counts.of(OverrunCause::wakeup), counts.of(OverrunCause::read),
      counts.of(OverrunCause::control), counts.of(OverrunCause::write), counts.of(OverrunCause::record),
      counts.ticks_missed, late_->time_s, late.periods_skipped, rig::name_of(late.overrun_cause),
      rig::in_us(period_ns_), rig::in_us(late.wakeup_latency_ns), rig::in_us(late.read_ns), rig::in_us(late.control_ns),
      rig::in_us(late.write_ns), rig::in_us(late.record_ns));
  told_ = counts.total;
  late_.reset();  // the counters run ahead of the records: the next message needs the record of another late cycle
  return text;
}

}  // namespace abs_hil::runtime
