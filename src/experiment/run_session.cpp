#include "experiment/run_session.hpp"

#include <chrono>
#include <cmath>
#include <future>
#include <thread>
#include <utility>

namespace abs_hil::experiment {

namespace {

constexpr std::int64_t poll_interval_ns = 2'000'000;
/// When this thread was delayed, it hands on the gathered records in bursts of this size. LCM's receivers queue 30
/// messages of a channel and drop the rest.
constexpr std::size_t records_per_burst = 16;
constexpr std::int64_t burst_interval_ns = 500'000;
/// Records the ring holds: 0.8 s at 10 kHz, long enough for a slow disk.
constexpr std::size_t ring_capacity = 8192;
constexpr int fast_cycles_per_drain = 1000;

std::int64_t period_ns_for(double rate_Hz) noexcept { return std::llround(1e9 / rate_Hz); }

/// Time for the cycle's thread to start.
constexpr std::int64_t start_margin_ns = 100'000'000;

std::int64_t next_second_ns(std::int64_t now_ns) noexcept {
  constexpr std::int64_t second_ns = 1'000'000'000;
  return (now_ns / second_ns + 1) * second_ns;
}

/// Puts the rig in the safe state, however the run ends.
class ActiveDriver {
 public:
  ActiveDriver(driver::RigDriver& driver, std::int64_t now_ns) : driver_(driver) {
    driver_.configure();
    driver_.activate(now_ns);
  }
  ActiveDriver(const ActiveDriver&) = delete;
  ActiveDriver& operator=(const ActiveDriver&) = delete;
  ~ActiveDriver() { static_cast<void>(driver_.deactivate()); }

 private:
  driver::RigDriver& driver_;
};

}  // namespace

RunSession::RunSession(runtime::Clock& clock, driver::RigDriver& driver, RunLogicParts parts,
                       const runtime::GateOptions& gate_options, std::vector<rig::RecordSink*> sinks,
                       const runtime::OverrunOptions& overruns)
    : clock_(clock),
      driver_(driver),
      logic_(std::move(parts)),
      gate_(logic_.make_gate(gate_options)),
      ring_(ring_capacity),
      executive_(clock, driver, logic_, gate_, ring_, period_ns_for(parts.control.rate_Hz), overruns),
      pump_(ring_, parts.recorded_r2_m, std::move(sinks)) {}

RunOutcome RunSession::outcome() const {
  return {.reason = logic_.end_reason(),
          .reason_value = logic_.end_value(),
          .io_error = executive_.io_error(),
          .safe_state = safe_state_,
          .realtime = realtime_,
          .ran = ran_};
}

bool RunSession::make_safe_now() noexcept { return driver_.deactivate().ok(); }

bool RunSession::have_made_safe() noexcept {
  constexpr int tries = 100;
  executive_.request_stop(rig::Reason::terminate_signal);
  for (int i = 0; i < tries && !made_safe_.load(std::memory_order_acquire); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return made_safe_.load(std::memory_order_acquire) && safe_state_.ok();
}

bool RunSession::step() noexcept {
  if (!slow_cycles_) return executive_.step();
  slow_cycles_->cycle_begins();
  const bool more = executive_.step();
  slow_cycles_->cycle_ended();
  return more;
}

RunOutcome RunSession::run_fast(const Poll& poll, bool own_thread) {
  const ActiveDriver active(driver_, clock_.now_ns());
  const runtime::CycleInThisThread cycle(*this, own_thread);
  if (watch_slow_cycles_) slow_cycles_.emplace(executive_.period_ns());
  ran_ = true;
  bool running = true;
  while (running) {
    for (int i = 0; i < fast_cycles_per_drain && running; ++i) running = step();
    pump_.drain();
    if (const rig::Reason stop = poll(); stop != rig::Reason::none) executive_.request_stop(stop);
  }
  slow_cycles_.reset();
  safe_state_ = driver_.deactivate();
  made_safe_.store(true, std::memory_order_release);
  pump_.finish();
  return outcome();
}

RunOutcome RunSession::run_realtime(const runtime::RealtimeOptions& options, const Poll& poll) {
  std::promise<runtime::RealtimeReport> set_up;
  std::promise<bool> go;
  std::atomic<bool> running{true};
  std::jthread cycle([&] {
    runtime::keep_signals_away();
    const runtime::RealtimeScope realtime(options);
    set_up.set_value(realtime.report());
    if (go.get_future().get()) {
      const runtime::CycleInThisThread here(*this, true);
      while (step()) {
      }
      // Called here and not in the slow thread: nothing must delay the safe state.
      safe_state_ = driver_.deactivate();
      made_safe_.store(true, std::memory_order_release);
      driver_.tell_before_making_safe(nullptr);
      if (guard_ != nullptr) guard_->outputs_released(safe_state_.ok());
    }
    running.store(false, std::memory_order_release);
  });

  realtime_ = set_up.get_future().get();
  if (options.mode == runtime::RealtimeMode::require && !realtime_.realtime()) {
    go.set_value(false);
    return outcome();
  }
  try {
    driver_.configure();
    if (guard_ != nullptr) {
      guard_->arm(realtime_.scheduling);
      driver_.tell_before_making_safe(guard_);
    }
    std::int64_t start_ns = clock_.now_ns();
    if (second_offset_ns_ >= 0) {
      start_ns = next_second_ns(start_ns + start_margin_ns) + second_offset_ns_;
      executive_.start_at(start_ns);
    }
    // The time of a simulated rig begins with the first cycle.
    driver_.activate(start_ns);
  } catch (...) {
    driver_.tell_before_making_safe(nullptr);
    go.set_value(false);
    throw;
  }
  ran_ = true;
  if (watch_slow_cycles_) slow_cycles_.emplace(0);
  go.set_value(true);
  try {
    while (running.load(std::memory_order_acquire)) {
      const bool more = pump_.drain(records_per_burst) == records_per_burst;
      if (const rig::Reason stop = poll(); stop != rig::Reason::none) executive_.request_stop(stop);
      clock_.sleep_until(clock_.now_ns() + (more ? burst_interval_ns : poll_interval_ns));
    }
  } catch (...) {
    // Without the slow thread nothing is recorded: end the run in order, then report the error.
    executive_.request_stop(rig::Reason::terminate_signal);
    cycle.join();
    throw;
  }
  cycle.join();
  slow_cycles_.reset();
  static_cast<void>(poll());  // answers the command that ended the run
  pump_.finish();
  return outcome();
}

}  // namespace abs_hil::experiment
