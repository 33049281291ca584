#include "runtime/record_pump.hpp"

#include <exception>
#include <utility>

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

}  // namespace abs_hil::runtime
