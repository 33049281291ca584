// Makes the parts of a run of its settings and drives its cycle in real or virtual time.
#include "run/run.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include "config/config_error.hpp"
#include "config/script.hpp"
#include "driver/factory.hpp"
#include "driver/sim/sim_driver.hpp"

namespace abs_hil::run {

namespace {

constexpr std::int64_t poll_interval_ns = 2'000'000;
/// When this thread was delayed, it hands on the gathered records in bursts of this size. LCM's receivers queue 30
/// messages of a channel and drop the rest.
constexpr std::size_t records_per_burst = 16;
constexpr std::int64_t burst_interval_ns = 500'000;
constexpr int fast_cycles_per_drain = 1000;

/// Records the ring holds. Clearing a large one costs more than a run that steps or does not wait.
std::size_t ring_capacity(const Given& given) noexcept {
  if (given.stepped) return 2;                            // it is emptied after every cycle
  return given.real_time ? 8192 : fast_cycles_per_drain;  // 0.8 s at 10 kHz, long enough for a slow disk
}

/// A controller whose steps take long must not keep Ctrl-C waiting.
constexpr std::int64_t fast_drain_max_ns = 100'000'000;
constexpr int fast_cycles_per_look = 8;

/// Time for the cycle's thread to start.
constexpr std::int64_t start_margin_ns = 100'000'000;

std::int64_t next_second_ns(std::int64_t now_ns) noexcept {
  constexpr std::int64_t second_ns = 1'000'000'000;
  return (now_ns / second_ns + 1) * second_ns;
}

std::unique_ptr<runtime::Clock> clock_of(const Given& given) {
  if (given.clock != nullptr) return nullptr;
  if (given.real_time) return std::make_unique<runtime::MonotonicClock>();
  return std::make_unique<runtime::VirtualClock>();
}

InjectFaults injects = nullptr;

/// The driver with the injected faults of the settings around it, if there are any.
std::unique_ptr<driver::RigDriver> with_faults(std::unique_ptr<driver::RigDriver> driver, const config::Settings& s,
                                               runtime::Clock& clock) {
  const std::vector<config::Injection> faults = config::parse_injections(s.inject);
  if (faults.empty()) return driver;
  if (injects == nullptr) {
    throw config::ConfigError(fmt::format(
        "run.inject = {}: this build injects no faults; configure it with -DABS_HIL_INJECTION=ON", s.inject));
  }
  for (const config::Injection& fault : faults) spdlog::warn("fault injected: {}", config::to_text(fault));
  return injects(std::move(driver), faults, static_cast<std::uint64_t>(s.seed), clock);
}

const plant_sim::PlantOptions& plant_of(const Prepared& prepared, const Given& given) noexcept {
  return given.plant != nullptr ? *given.plant : prepared.settings.plant;
}

std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& s, bool virtual_time,
                                               const plant_sim::PlantOptions& plant, std::uint64_t sensor_seed) {
  if (s.on_rig()) return driver::make_rig_driver(s.driver, virtual_time);
  return std::make_unique<driver::SimDriver>(
      plant, driver::SimStart{.seed = sensor_seed,
                              .start_speed_rad_s = s.experiment.start_speed_rad_s,
                              .pwm_mode = driver::pwm_mode_named(s.driver.sim.pwm_mode)});
}

std::unique_ptr<driver::RigDriver> driver_of(const Prepared& prepared, const Given& given, runtime::Clock& clock) {
  if (given.driver != nullptr) return nullptr;
  const config::Settings& s = prepared.settings;
  const std::uint64_t seed = given.sensor_seed ? *given.sensor_seed : config::sensor_seed(s);
  return with_faults(make_driver(s, !given.real_time, plant_of(prepared, given), seed), s, clock);
}

experiment::RunLogicParts parts_of(const Prepared& prepared, const Given& given) {
  experiment::RunLogicParts parts = prepared.logic_parts(plant_of(prepared, given));
  if (given.controller) parts.controller = given.controller(std::move(parts.controller));
  return parts;
}

}  // namespace

void inject_by(InjectFaults inject) noexcept { injects = inject; }

std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& s) {
  return make_driver(s, false, s.plant, config::sensor_seed(s));
}

Prepared::Prepared(const config::Settings& s) : Prepared(s, *config::find(s.experiment.name)) {}

Prepared::Prepared(const config::Settings& s, const config::Script& script) : Prepared(s, config::plan(script, s)) {
  analysis = script.analysis;
}

Prepared::Prepared(const config::Settings& s, config::Plan its_plan)
    : settings(s),
      plan(std::move(its_plan)),
      period_ns(std::llround(1e9 / s.control.rate_Hz)),
      to_stop(config::means_to_stop(plan, s.experiment.end_speed_m_s)) {}

experiment::RunLogicParts Prepared::logic_parts(const plant_sim::PlantOptions& plant) const {
  const config::Settings& s = settings;
  experiment::RunLogicParts parts =
      experiment::make_logic_parts(s.control, s.model, s.on_rig() ? s.rig.parameters : plant_sim::identity_of(plant),
                                   s.plant.ideal_actuator, s.gate, s.experiment, plan.phases, plan.limits);
  parts.duty_steps = config::output_grid(s, plant).duty_steps;
  return parts;
}

/// Ends the program with status 1 if one cycle takes 5 s, or in virtual time if all cycles together take 20 s and a
/// hundred times the time that they simulate: a controller in this process does not return, or is too slow. It counts
/// its own waking moments of 0.1 s, so that a stopped program or a debugger is no slow cycle.
class Run::SlowCycleWatch {
 public:
  /// @param period_ns  of virtual time; 0: real time, which limits no whole
  explicit SlowCycleWatch(std::int64_t period_ns) : period_s_(static_cast<double>(period_ns) * 1e-9) {}
  SlowCycleWatch(const SlowCycleWatch&) = delete;
  SlowCycleWatch& operator=(const SlowCycleWatch&) = delete;
  ~SlowCycleWatch() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    end_.notify_all();
    thread_.join();
  }
  /// Real-time safe.
  void cycle_begins() noexcept { inside_.store(true, std::memory_order_relaxed); }
  void cycle_ended() noexcept {
    cycles_.store(cycles_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    inside_.store(false, std::memory_order_relaxed);
  }

 private:
  void watch() {
    constexpr auto tick = std::chrono::milliseconds(100);
    constexpr double tick_s = 0.1;
    constexpr double cycle_max_s = 5.0;
    constexpr double whole_grace_s = 20.0;
    constexpr double slowness_max = 100.0;
    runtime::keep_signals_away();
    std::uint64_t seen = 0;
    double same_s = 0.0;
    double whole_s = 0.0;
    std::unique_lock lock(mutex_);
    while (!end_.wait_for(lock, tick, [this] { return ending_; })) {
      const std::uint64_t cycles = cycles_.load(std::memory_order_relaxed);
      const bool inside = inside_.load(std::memory_order_relaxed);
      same_s = inside && cycles == seen ? same_s + tick_s : 0.0;
      if (inside) whole_s += tick_s;
      seen = cycles;
      if (same_s > cycle_max_s) {
        runtime::end_early("fault: a cycle takes more than 5 s: the controller in this program does not return", false);
      }
      if (period_s_ > 0.0 && whole_s > whole_grace_s + slowness_max * period_s_ * static_cast<double>(cycles)) {
        runtime::end_early(
            "fault: the run takes more than 20 s and 100 times the time that it simulates: its controller is too slow",
            false);
      }
    }
  }

  double period_s_;
  std::atomic<std::uint64_t> cycles_{0};
  std::atomic<bool> inside_{false};
  std::mutex mutex_{};
  std::condition_variable end_{};
  bool ending_{false};
  std::thread thread_{[this] { watch(); }};  // macOS has no jthread
};

Run::~Run() = default;

Run::Run(const Prepared& prepared, const Given& given) : Run(prepared, given, parts_of(prepared, given)) {}

Run::Run(const Prepared& prepared, const Given& given, experiment::RunLogicParts parts)
    : prepared_(prepared),
      real_time_(given.real_time),
      names_(std::move(parts.names)),
      own_clock_(clock_of(given)),
      clock_(own_clock_ ? *own_clock_ : *given.clock),
      own_driver_(driver_of(prepared, given, clock_)),
      driver_(own_driver_ ? *own_driver_ : *given.driver),
      logic_(std::move(parts)),
      outer_logic_(given.logic ? given.logic(logic_) : nullptr),
      gate_(logic_.make_gate(settings().gate, given.checks_wheels)),
      ring_(ring_capacity(given)),
      executive_(clock_, driver_, outer_logic_ ? *outer_logic_ : logic_, gate_, ring_, prepared.period_ns,
                 given.overruns.value_or(settings().realtime.overruns), !given.stepped),
      metrics_(plant_of(prepared, given).rig.wheels.r2_m, settings().experiment.end_speed_m_s),
      pump_(ring_, plant_of(prepared, given).rig.wheels.r2_m, {&metrics_}) {
  if (prepared.analysis != "friction-curve") return;
  // As on a rig, where only the model is known: the force is found from the encoders.
  friction_curve_.emplace(settings().model.wheels, settings().model.encoder_counts_per_rev);
  pump_.add(*friction_curve_);
}

void Run::record_into(const std::vector<rig::RecordSink*>& sinks) {
  for (rig::RecordSink* sink : sinks) pump_.add(*sink);
}

void Run::begin() {
  driver_.configure();
  driver_.activate(clock_.now_ns());
}

rig::Reason Run::end_reason() const noexcept {
  const rig::Reason reason = logic_.end_reason();
  if (reason == rig::Reason::sequence_complete && !safe_state_.ok()) return rig::Reason::safe_state_unverified;
  const bool moves_on = reason == rig::Reason::sequence_complete && prepared_.to_stop && metrics_.moves_on();
  return moves_on ? rig::Reason::braking_without_stop : reason;
}

RunOutcome Run::outcome() const {
  const rig::Reason reason = end_reason();
  return {.reason = reason,
          .reason_value =
              reason == rig::Reason::braking_without_stop ? metrics_.metrics().final_speed_m_s : logic_.end_value(),
          .io_error = executive_.io_error(),
          .safe_state = safe_state_,
          .realtime = realtime_,
          .ran = ran_};
}

RunOutcome Run::go_guarded(const Poll& poll) {
  if (real_time_) return run_realtime(poll);
  std::packaged_task<RunOutcome()> task([&] { return run_fast(poll, true); });
  std::future<RunOutcome> outcome = task.get_future();
  std::jthread(std::move(task)).join();
  return outcome.get();
}

bool Run::make_safe_now() noexcept { return driver_.deactivate().ok(); }

bool Run::have_made_safe() noexcept {
  constexpr int tries = 100;
  executive_.request_stop(rig::Reason::terminate_signal);
  for (int i = 0; i < tries && !made_safe_.load(std::memory_order_acquire); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return made_safe_.load(std::memory_order_acquire) && safe_state_.ok();
}

bool Run::step() noexcept {
  if (!slow_cycles_) return executive_.step();
  slow_cycles_->cycle_begins();
  const bool more = executive_.step();
  slow_cycles_->cycle_ended();
  return more;
}

RunOutcome Run::run_fast(const Poll& poll, bool own_thread) {
  begin();
  // Puts the rig in the safe state, however the run ends.
  const std::unique_ptr<driver::RigDriver, void (*)(driver::RigDriver*)> active(
      &driver_, [](driver::RigDriver* driver) { static_cast<void>(driver->deactivate()); });
  const runtime::CycleInThisThread cycle(*this, own_thread);
  if (watch_slow_cycles_) slow_cycles_ = std::make_unique<SlowCycleWatch>(executive_.period_ns());
  ran_ = true;
  bool running = true;
  runtime::MonotonicClock wall;
  while (running) {
    const std::int64_t begun_ns = wall.now_ns();
    for (int i = 0; i < fast_cycles_per_drain && running; ++i) {
      running = step();
      if (i % fast_cycles_per_look == 0 && wall.now_ns() - begun_ns > fast_drain_max_ns) break;
    }
    pump_.drain();
    if (const rig::Reason stop = poll(); stop != rig::Reason::none) executive_.request_stop(stop);
  }
  slow_cycles_.reset();
  safe_state_ = driver_.deactivate();
  made_safe_.store(true, std::memory_order_release);
  pump_.finish();
  return outcome();
}

RunOutcome Run::run_realtime(const Poll& poll) {
  const runtime::RealtimeOptions& options = settings().realtime;
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
    std::int64_t start_ns = -1;
    if (second_offset_ns_ >= 0) {
      start_ns = next_second_ns(clock_.now_ns() + start_margin_ns) + second_offset_ns_;
      executive_.start_at(start_ns);
      clock_.sleep_until(start_ns - rig::ns_per_s / 2);  // the guard expects the first cycle within a second
    }
    if (guard_ != nullptr) {
      guard_->arm(realtime_.scheduling);
      driver_.tell_before_making_safe(guard_);
    }
    // The time of a simulated rig begins with the first cycle.
    driver_.activate(start_ns < 0 ? clock_.now_ns() : start_ns);
  } catch (...) {
    driver_.tell_before_making_safe(nullptr);
    go.set_value(false);
    throw;
  }
  ran_ = true;
  if (watch_slow_cycles_) slow_cycles_ = std::make_unique<SlowCycleWatch>(0);
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

}  // namespace abs_hil::run
