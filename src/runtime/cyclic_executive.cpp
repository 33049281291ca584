// The cycle: read, estimate, sequence, control, gate, write, record, once per period.
#include "runtime/cyclic_executive.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

namespace {
static_assert(std::atomic<rig::Reason>::is_always_lock_free, "request_stop is called from signal handlers");

std::uint64_t count_of(int value) noexcept { return static_cast<std::uint64_t>(std::max(value, 0)); }

constexpr double gap_without_guardian_s = 0.1;
constexpr std::int64_t least_gap_periods = 3;

std::int64_t longest_gap_ns(double wanted_s, std::int64_t period_ns) noexcept {
  const double gap_s = wanted_s > 0.0 ? wanted_s : gap_without_guardian_s;
  return std::max(static_cast<std::int64_t>(gap_s * static_cast<double>(rig::ns_per_s)), least_gap_periods * period_ns);
}

/// The part of the cycle that took longest; the first one if several are equal.
rig::OverrunCause longest_part(const rig::CycleTiming& timing, std::int64_t record_ns) noexcept {
  using Part = std::pair<std::int64_t, rig::OverrunCause>;
  const std::array<Part, 5> parts{{{timing.wakeup_latency_ns, rig::OverrunCause::wakeup},
                                   {timing.read_ns, rig::OverrunCause::read},
                                   {timing.control_ns, rig::OverrunCause::control},
                                   {timing.write_ns, rig::OverrunCause::write},
                                   {record_ns, rig::OverrunCause::record}}};
  return std::max_element(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.first < b.first; })
      ->second;
}
}  // namespace

CyclicExecutive::CyclicExecutive(Clock& clock, driver::RigDriver& driver, CycleLogic& logic, CommandGate& gate,
                                 RecordRing& ring, std::int64_t period_ns, const OverrunOptions& overruns, bool timed)
    : clock_(clock),
      driver_(driver),
      logic_(logic),
      gate_(gate),
      ring_(ring),
      period_ns_(period_ns),
      startup_cycles_(count_of(overruns.startup_cycles)),
      max_consecutive_(count_of(overruns.max_consecutive)),
      late_max_ns_(static_cast<std::int64_t>(overruns.late_max_s * static_cast<double>(rig::ns_per_s))),
      gap_max_ns_(longest_gap_ns(overruns.cycle_gap_max_s, period_ns)),
      statistics_(timed ? std::make_unique<CycleStatistics>() : nullptr) {}

void CyclicExecutive::request_stop(rig::Reason reason) noexcept {
  rig::Reason none = rig::Reason::none;
  stop_request_.compare_exchange_strong(none, reason, std::memory_order_relaxed);
}

bool CyclicExecutive::step() noexcept {
  if (sequence_ == 0) tick_ns_ = first_tick_ns_ < 0 ? clock_.now_ns() : first_tick_ns_;
  clock_.sleep_until(tick_ns_);
  rig::CycleRecord record;
  run_cycle(record);
  keep(record);
  schedule_next(record.timing);
  return !logic_.finished();
}

void CyclicExecutive::watch_time(std::int64_t woken_ns) noexcept {
  if (sequence_ == 0) suspensions_.begin(clock_);
  const std::int64_t suspended_ns = suspensions_.look(clock_);
  const std::int64_t gap_ns = woken_ns - std::exchange(woken_ns_, woken_ns);
  if (!acting_) return;
  if (suspended_ns > 0) {
    gate_.latch(rig::Reason::computer_suspended, static_cast<double>(suspended_ns) * rig::s_per_ns);
  }
  if (gap_ns > gap_max_ns_) gate_.latch(rig::Reason::cycle_gap, static_cast<double>(gap_ns) * rig::s_per_ns);
}

// The program stood still between the wake-up and the write. What it computed before must not be sent afterwards.
void CyclicExecutive::latch_stale_command(std::int64_t age_ns) noexcept {
  if (acting_) gate_.latch(rig::Reason::cycle_gap, static_cast<double>(age_ns) * rig::s_per_ns);
}

void CyclicExecutive::run_cycle(rig::CycleRecord& record) noexcept {
  GuardianSign guardian{};
  if (watch_ != nullptr) guardian = watch_->beat();
  const bool guardian_silent = guardian.reason == rig::Reason::guardian_silent;
  if (guardian_silent) gate_.latch(guardian.reason, static_cast<double>(guardian.silent_cycles));
  const std::int64_t woken_ns = clock_.now_ns();
  watch_time(woken_ns);
  // After the clock: a pause of the whole computer is the reason then, not what the guardian made of it.
  if (!guardian_silent && guardian.reason != rig::Reason::none) gate_.latch(guardian.reason, 0.0);
  if (sequence_ == 0) start_ns_ = woken_ns;
  record.sequence = sequence_++;
  record.stamp_ns = woken_ns;
  record.time_s = static_cast<double>(woken_ns - start_ns_) * rig::s_per_ns;
  record.timing.wakeup_latency_ns = woken_ns - tick_ns_;
  record.timing.record_ns = record_ns_;
  record.timing.periods_skipped = periods_skipped_;
  record.timing.overrun_cause = overrun_cause_;

  rig::Measurement latest;
  const driver::IoResult read = driver_.read(woken_ns, latest);
  const std::int64_t read_ns = clock_.now_ns();
  record.timing.read_ns = read_ns - woken_ns;
  bool valid = false;
  if (!read.ok()) {
    if (io_error_.ok()) io_error_ = read;
    gate_.latch(driver::reason_of(read, rig::Reason::driver_read_failed), static_cast<double>(read.error));
  } else {
    if (rig::Command acted; driver_.took_other_command(acted)) {
      gate_.note_sent(acted);
      logic_.commanded(acted);
    }
    valid = gate_.check_measurement(latest, woken_ns, record.timing.read_ns);
    if (valid || record.sequence == 0) measurement_ = latest;
  }
  record.measurement = measurement_;
  record.sample_valid = valid;
  record.sample_time_s = static_cast<double>(measurement_.time_ns - start_ns_) * rig::s_per_ns;
  record.truth = driver_.truth();

  if (const rig::Reason stop = stop_request_.load(std::memory_order_relaxed); stop != rig::Reason::none) {
    gate_.latch(stop, 0.0);
  }
  logic_.wheels_judged(gate_.wheels_sound());
  const rig::Command wanted = logic_.step(measurement_, gate_, record);
  driver_.note_phase(record.phase);
  if (record.wheels_apart != wheels_apart_) note_wheels_apart(record.wheels_apart);
  const GateResult gated = gate_.check(wanted, {record.control.speeds_est, record.phase, woken_ns});
  acting_ = rig::acts(gated.command);
  const std::int64_t control_ns = clock_.now_ns();
  const bool stale = control_ns - woken_ns > gap_max_ns_;
  if (stale) latch_stale_command(control_ns - woken_ns);

  const driver::IoResult written = driver_.write(stale ? rig::safe_command : gated.command, record.command);
  if (!written.ok()) {
    if (io_error_.ok()) io_error_ = written;
    gate_.latch(driver::reason_of(written, rig::Reason::driver_write_failed), static_cast<double>(written.error));
  }
  gate_.note_sent(record.command);
  logic_.commanded(record.command);
  const std::int64_t written_ns = clock_.now_ns();

  record.timing.control_ns = control_ns - read_ns;
  record.timing.write_ns = written_ns - control_ns;
  record.timing.cycle_ns = written_ns - woken_ns;
}

void CyclicExecutive::note_wheels_apart(bool apart) noexcept {
  wheels_apart_ = apart;
  driver_.note_wheels_apart(apart);
  gate_.note_wheels_apart(apart);
}

void CyclicExecutive::keep(const rig::CycleRecord& record) noexcept {
  if (statistics_ != nullptr) {
    statistics_->count_cycle();
    if (!starting_up()) statistics_->add(record.timing);
  }
  ring_.push(record);
  if (watch_ != nullptr) watch_->keep(record);
}

void CyclicExecutive::schedule_next(const rig::CycleTiming& timing) noexcept {
  const std::int64_t now_ns = clock_.now_ns();
  record_ns_ = now_ns - (tick_ns_ + timing.wakeup_latency_ns + timing.cycle_ns);
  periods_skipped_ = 0;
  overrun_cause_ = rig::OverrunCause::none;
  const std::int64_t began_ns = std::exchange(tick_ns_, tick_ns_ + period_ns_);
  if (now_ns < tick_ns_) {
    late_since_ns_ = -1;
    if (statistics_ != nullptr) statistics_->count_cycle_in_time();
    return;
  }
  const std::int64_t missed = (now_ns - tick_ns_) / period_ns_ + 1;
  tick_ns_ += missed * period_ns_;
  count_late(timing, missed, began_ns, now_ns);
}

void CyclicExecutive::count_late(const rig::CycleTiming& timing, std::int64_t ticks_missed, std::int64_t began_ns,
                                 std::int64_t now_ns) noexcept {
  periods_skipped_ = static_cast<std::uint32_t>(ticks_missed);
  overrun_cause_ = longest_part(timing, record_ns_);
  if (statistics_ == nullptr) return;
  if (starting_up()) {
    statistics_->count_startup_overrun();
    return;
  }
  const std::uint64_t in_a_row = statistics_->count_overrun(overrun_cause_, static_cast<std::uint64_t>(ticks_missed));
  if (late_since_ns_ < 0) late_since_ns_ = began_ns;
  const bool too_long = in_a_row > 1 && now_ns - late_since_ns_ >= late_max_ns_;
  // The next cycle finds the fault latched and sends the safe command.
  if (in_a_row == max_consecutive_ || too_long) {
    gate_.latch(rig::Reason::consecutive_overruns, static_cast<double>(in_a_row));
  }
}

}  // namespace abs_hil::runtime
