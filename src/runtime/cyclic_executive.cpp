#include "abs_hil/runtime/cyclic_executive.hpp"

namespace abs_hil::runtime {

namespace {
constexpr double s_per_ns = 1e-9;
static_assert(std::atomic<rig::Reason>::is_always_lock_free, "request_stop is called from signal handlers");
}  // namespace

CyclicExecutive::CyclicExecutive(Clock& clock, driver::RigDriver& driver, CycleLogic& logic, CommandGate& gate,
                                 RecordRing& ring, std::int64_t period_ns) noexcept
    : clock_(clock), driver_(driver), logic_(logic), gate_(gate), ring_(ring), period_ns_(period_ns) {}

void CyclicExecutive::request_stop(rig::Reason reason) noexcept {
  rig::Reason none = rig::Reason::none;
  stop_request_.compare_exchange_strong(none, reason, std::memory_order_relaxed);
}

bool CyclicExecutive::step() noexcept {
  if (sequence_ == 0) tick_ns_ = clock_.now_ns();
  clock_.sleep_until(tick_ns_);
  rig::CycleRecord record;
  run_cycle(record);
  ring_.push(record);
  schedule_next(record);
  return !logic_.finished();
}

void CyclicExecutive::run_cycle(rig::CycleRecord& record) noexcept {
  const std::int64_t woken_ns = clock_.now_ns();
  if (sequence_ == 0) start_ns_ = woken_ns;
  record.sequence = sequence_++;
  record.stamp_ns = woken_ns;
  record.time_s = static_cast<double>(woken_ns - start_ns_) * s_per_ns;
  record.timing.wakeup_latency_ns = woken_ns - tick_ns_;
  record.timing.periods_skipped = periods_skipped_;

  const driver::IoResult read = driver_.read(woken_ns, measurement_);
  if (!read.ok()) {
    io_error_ = read;
    gate_.latch(rig::Reason::driver_read_failed, static_cast<double>(read.error));
  } else if (measurement_.trip_flags != 0) {
    gate_.latch(rig::Reason::board_interlock_tripped, static_cast<double>(measurement_.trip_flags));
  }
  record.measurement = measurement_;
  record.truth = driver_.truth();
  const std::int64_t read_ns = clock_.now_ns();

  if (const rig::Reason stop = stop_request_.load(std::memory_order_relaxed); stop != rig::Reason::none) {
    logic_.end_early(stop, 0.0);
  }
  if (gate_.fault() != rig::Reason::none) logic_.end_early(gate_.fault(), gate_.fault_value());
  const rig::Command wanted = logic_.step(measurement_, record);
  const GateResult gated = gate_.check(wanted, record.control.speeds_est);
  record.command = gated.command;
  if (gated.fault != rig::Reason::none) logic_.end_early(gated.fault, gated.fault_value);
  const std::int64_t control_ns = clock_.now_ns();

  const driver::IoResult written = driver_.write(gated.command);
  if (!written.ok()) {
    io_error_ = written;
    gate_.latch(rig::Reason::driver_write_failed, static_cast<double>(written.error));
    logic_.end_early(rig::Reason::driver_write_failed, static_cast<double>(written.error));
  }
  logic_.commanded(gated.command);
  const std::int64_t written_ns = clock_.now_ns();

  record.timing.read_ns = read_ns - woken_ns;
  record.timing.control_ns = control_ns - read_ns;
  record.timing.write_ns = written_ns - control_ns;
  record.timing.cycle_ns = written_ns - woken_ns;
}

void CyclicExecutive::schedule_next(rig::CycleRecord& record) noexcept {
  wakeup_latency_.add(record.timing.wakeup_latency_ns);
  cycle_time_.add(record.timing.cycle_ns);
  counters_.cycles.store(sequence_, std::memory_order_relaxed);
  tick_ns_ += period_ns_;
  const std::int64_t late_ns = clock_.now_ns() - tick_ns_;
  periods_skipped_ = 0;
  if (late_ns >= 0) {
    const std::int64_t missed = late_ns / period_ns_ + 1;
    tick_ns_ += missed * period_ns_;
    periods_skipped_ = static_cast<std::uint32_t>(missed);
    counters_.overruns.store(counters_.overruns.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }
}

}  // namespace abs_hil::runtime
