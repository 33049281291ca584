#include "runtime/cycle_statistics.hpp"

#include "runtime/single_writer.hpp"

namespace abs_hil::runtime {

namespace {
constexpr std::uint64_t one = 1;
}

void CycleStatistics::add(const rig::CycleTiming& timing) noexcept {
  wakeup_latency_.add(timing.wakeup_latency_ns);
  read_.add(timing.read_ns);
  control_.add(timing.control_ns);
  write_.add(timing.write_ns);
  cycle_time_.add(timing.cycle_ns);
}

void CycleStatistics::count_cycle() noexcept { add_as_single_writer(cycles_, one); }

void CycleStatistics::count_startup_overrun() noexcept { add_as_single_writer(startup_overruns_, one); }

std::uint64_t CycleStatistics::count_overrun(rig::OverrunCause cause, std::uint64_t ticks_missed) noexcept {
  add_as_single_writer(overruns_[static_cast<std::size_t>(cause)], one);
  add_as_single_writer(ticks_missed_, ticks_missed);
  ++run_;
  if (run_ > longest_run_.load(std::memory_order_relaxed)) longest_run_.store(run_, std::memory_order_relaxed);
  return run_;
}

rig::OverrunCounts CycleStatistics::overruns() const noexcept {
  rig::OverrunCounts counts{.startup = startup_overruns_.load(std::memory_order_relaxed),
                            .ticks_missed = ticks_missed_.load(std::memory_order_relaxed),
                            .longest_run = longest_run_.load(std::memory_order_relaxed)};
  for (std::size_t i = 0; i < counts.by_cause.size(); ++i) {
    counts.by_cause[i] = overruns_[i].load(std::memory_order_relaxed);
    counts.total += counts.by_cause[i];
  }
  return counts;
}

rig::TimingSummary CycleStatistics::summary() const noexcept {
  return {.wakeup_latency = wakeup_latency_.summary(),
          .read = read_.summary(),
          .control = control_.summary(),
          .write = write_.summary(),
          .cycle_time = cycle_time_.summary(),
          .overruns = overruns()};
}

}  // namespace abs_hil::runtime
