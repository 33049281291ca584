#include "runtime/overrun_reporter.hpp"

#include <array>
#include <cstdio>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

namespace {

constexpr std::int64_t message_period_ns = 1'000'000'000;

unsigned long long count_of(const rig::OverrunCounts& counts, rig::OverrunCause cause) { return counts.of(cause); }

}  // namespace

void OverrunReporter::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  // The next record tells what a cycle missed. If a record was dropped, the late cycle's own times are lost.
  if (record.timing.periods_skipped > 0 && record.sequence == latest_.sequence + 1) {
    late_ = LateCycle{.timing = latest_.timing,
                      .record_ns = record.timing.record_ns,
                      .ticks_missed = record.timing.periods_skipped,
                      .cause = record.timing.overrun_cause,
                      .time_s = latest_.time_s};
  }
  latest_ = record;
}

std::optional<std::string> OverrunReporter::message(const rig::OverrunCounts& counts) {
  if (counts.total <= told_ || !late_) return std::nullopt;
  if (next_message_ns_ && latest_.stamp_ns < *next_message_ns_) return std::nullopt;
  next_message_ns_ = latest_.stamp_ns + message_period_ns;

  std::array<char, 512> text{};
  const auto cause = rig::name_of(late_->cause);
  const int size = std::snprintf(
      text.data(), text.size(),
      "%llu late cycles (%llu new; wakeup %llu, read %llu, control %llu, write %llu, record %llu), %llu ticks missed; "
      "the latest at %.3f s missed %u because of %.*s: period %.0f us, woke %.0f us late, read %.0f, control %.0f, "
      "write %.0f, record %.0f us",
      static_cast<unsigned long long>(counts.total), static_cast<unsigned long long>(counts.total - told_),
      count_of(counts, rig::OverrunCause::wakeup), count_of(counts, rig::OverrunCause::read),
      count_of(counts, rig::OverrunCause::control), count_of(counts, rig::OverrunCause::write),
      count_of(counts, rig::OverrunCause::record), static_cast<unsigned long long>(counts.ticks_missed), late_->time_s,
      late_->ticks_missed, static_cast<int>(cause.size()), cause.data(), rig::in_us(period_ns_),
      rig::in_us(late_->timing.wakeup_latency_ns), rig::in_us(late_->timing.read_ns),
      rig::in_us(late_->timing.control_ns), rig::in_us(late_->timing.write_ns), rig::in_us(late_->record_ns));
  told_ = counts.total;
  late_.reset();  // the counters run ahead of the records: the next message needs the record of another late cycle
  return size > 0 ? std::optional<std::string>(text.data()) : std::nullopt;
}

}  // namespace abs_hil::runtime
