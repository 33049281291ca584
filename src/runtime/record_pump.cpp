#include "runtime/record_pump.hpp"

#include <exception>
#include <utility>

namespace abs_hil::runtime {

RecordPump::RecordPump(RecordRing& ring, double r2_m, std::vector<rig::RecordSink*> sinks)
    : ring_(ring), r2_m_(r2_m), sinks_(std::move(sinks)) {}

void RecordPump::add_distance(const rig::CycleRecord& record) noexcept {
  if (braking_) {
    const double before_m_s = r2_m_ * rig::best_speeds(latest_).omega2_rad_s;
    const double now_m_s = r2_m_ * rig::best_speeds(record).omega2_rad_s;
    distance_m_ += 0.5 * (before_m_s + now_m_s) * (record.time_s - latest_.time_s);
  } else {
    braking_ = record.phase == rig::Phase::brake;
  }
}

std::size_t RecordPump::drain(std::size_t at_most) {
  std::size_t count = 0;
  rig::CycleRecord record;
  while (count < at_most && ring_.pop(record)) {
    add_distance(record);
    latest_ = record;
    for (rig::RecordSink* sink : sinks_) sink->consume(record, distance_m_);
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

}  // namespace abs_hil::runtime
