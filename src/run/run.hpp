#pragma once

// One run: the only place that puts driver, faults, plan, logic, gate, ring, cycle and metrics together. In real time,
// with --fast, of a series, a study or a replay, and from Python, a run is made of `Prepared` settings here; the lanes
// of studies have a loop of their own and take the same `Prepared`.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "analysis/friction_curve.hpp"
#include "analysis/run_metrics.hpp"
#include "analysis/run_summary.hpp"
#include "config/injection.hpp"
#include "config/plan.hpp"
#include "config/script.hpp"
#include "config/settings.hpp"
#include "experiment/run_logic.hpp"
#include "rig/record_sink.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/early_end.hpp"
#include "runtime/realtime_setup.hpp"
#include "runtime/record_pump.hpp"

namespace abs_hil::run {

/// What runs with the same settings have in common, prepared once.
struct Prepared {
  /// The experiment that the settings name, a script, or a plan made otherwise. `settings` must outlive this object and
  /// its runs. Throws config::ConfigError for an experiment that these settings cannot run.
  Prepared(const config::Settings& settings);  // NOLINT(google-explicit-constructor): a run needs no more
  Prepared(const config::Settings& settings, const config::Script& script);
  Prepared(const config::Settings& settings, config::Plan plan);

  /// Throws std::invalid_argument for options that cannot be used.
  /// @param plant  the simulated rig; not used on a board
  [[nodiscard]] experiment::RunLogicParts logic_parts(const plant_sim::PlantOptions& plant) const;

  const config::Settings& settings;
  config::Plan plan;
  std::string analysis{};  ///< of the records, as the script asks for it: "friction-curve"
  std::int64_t period_ns;
  bool to_stop;  ///< the experiment means to brake to a stop
};

/// What of a run its settings do not say. Without anything: in virtual time, as fast as possible.
struct Given {
  bool real_time{false};
  /// The caller steps the run with `cycle` in virtual time. It keeps no statistics of its timing.
  bool stepped{false};
  const plant_sim::PlantOptions* plant{nullptr};  ///< the simulated rig in place of `settings.plant`
  std::optional<std::uint64_t> sensor_seed{};     ///< in place of that of the settings
  runtime::Clock* clock{nullptr};                 ///< in place of real or virtual time; must outlive the run
  driver::RigDriver* driver{nullptr};             ///< in place of the settings' with its injected faults; likewise
  std::optional<runtime::OverrunOptions> overruns{};
  bool checks_wheels{true};  ///< false: the gate does not judge the motion of the wheels
  /// Makes of the settings' controller the one that runs.
  std::function<std::unique_ptr<control::SlipController>(std::unique_ptr<control::SlipController>)> controller{};
  /// Makes the logic that the cycle calls, around that of the run.
  std::function<std::unique_ptr<runtime::CycleLogic>(experiment::RunLogic&)> logic{};
};

/// The outcome of a run.
struct RunOutcome {
  rig::Reason reason{rig::Reason::none};
  double reason_value{0.0};
  driver::IoResult io_error{};    ///< the driver's first error
  driver::IoResult safe_state{};  ///< result of writing the safe state at the end
  runtime::RealtimeReport realtime{};
  bool ran{false};  ///< false: real time was required but unavailable; nothing moved
  [[nodiscard]] bool completed() const noexcept { return reason == rig::Reason::sequence_complete; }
};

/// One run, from an unconfigured driver to the safe state. It owns the data of the real-time thread; the sinks work in
/// the calling (slow) thread. If code in this program ends it during the run, the outputs are made safe first
/// (runtime::EarlyEndWatch).
class Run final : private runtime::Outputs {
 public:
  /// Throws driver::Unavailable for a board that is not there, std::invalid_argument and config::ConfigError for
  /// options that cannot be used.
  /// @param prepared  must outlive the run
  explicit Run(const Prepared& prepared, const Given& given = {});
  ~Run() override;

  /// These get every record, in this order, in the thread that calls `go`. Before the run.
  void record_into(const std::vector<rig::RecordSink*>& sinks);

  /// Called outside the real-time thread, every few milliseconds in real time and every second of virtual time. A
  /// reason other than `none` ends the run in order.
  using Poll = std::function<rig::Reason()>;

  /// The whole run: in real time with the cycle in a thread of its own, or in virtual time. Throws driver::Unavailable
  /// if the driver cannot start, and whatever a sink throws when it finishes; the rig is in the safe state in every
  /// case.
  RunOutcome go(const Poll& poll) { return real_time_ ? run_realtime(poll) : run_fast(poll, false); }
  /// The same, but in virtual time too the cycle has a thread of its own, in which a call of _exit() is caught.
  RunOutcome go_guarded(const Poll& poll);

  /// For a run that its caller steps: configures and activates the driver.
  void begin();
  /// One cycle, with its record handed to the sinks. False after the run's last cycle.
  bool cycle() {
    const bool more = executive_.step();
    pump_.drain();
    return more;
  }

  /// Ends the program if a controller in this process does not return or, in virtual time, is much too slow. Not for
  /// boards: their guardian ends such a run.
  void watch_for_slow_cycles() noexcept { watch_slow_cycles_ = true; }
  /// Lets a real-time run begin at the next whole second of the clock plus `offset_ns`, >= 0: its ticks then coincide
  /// with those of `cyclictest --secaligned`.
  void align_to_second(std::int64_t offset_ns) noexcept { second_offset_ns_ = offset_ns; }
  /// For real-time runs: `guard` stands by from before the driver's activation until its outputs are released. Both
  /// must outlive the run.
  void guard_with(runtime::RunGuard& guard) noexcept { guard_ = &guard; }
  void set_watch(runtime::Heartbeat& watch) noexcept { executive_.set_watch(watch); }
  /// Ends the run in an orderly way at its next cycle. Any thread or signal handler may call it.
  void request_stop(rig::Reason reason) noexcept { executive_.request_stop(reason); }
  /// Lets go of the board, after the run.
  void release_driver() noexcept { own_driver_.reset(); }

  [[nodiscard]] const Prepared& prepared() const noexcept { return prepared_; }
  [[nodiscard]] const config::Settings& settings() const noexcept { return prepared_.settings; }
  [[nodiscard]] bool real_time() const noexcept { return real_time_; }
  [[nodiscard]] const rig::RunNames& names() const noexcept { return names_; }
  [[nodiscard]] driver::RigDriver& driver() noexcept { return driver_; }
  [[nodiscard]] control::SlipController& controller() noexcept { return logic_.controller(); }
  [[nodiscard]] const experiment::RunLogic& logic() const noexcept { return logic_; }
  /// For one slow thread during the run.
  [[nodiscard]] experiment::AdjustmentMailbox& adjustments() noexcept { return logic_.adjustments(); }
  [[nodiscard]] const runtime::CyclicExecutive& executive() const noexcept { return executive_; }
  [[nodiscard]] const runtime::CommandGate& gate() const noexcept { return gate_; }
  [[nodiscard]] std::uint64_t record_drops() const noexcept { return ring_.drops(); }
  /// What the real-time set-up obtained. The slow thread may read it from its first poll on.
  [[nodiscard]] const runtime::RealtimeReport& realtime_report() const noexcept { return realtime_; }
  [[nodiscard]] const rig::CycleRecord& latest() const noexcept { return pump_.latest(); }
  [[nodiscard]] const analysis::RunMetrics& metrics() const noexcept { return metrics_; }
  /// Of an experiment with that analysis.
  [[nodiscard]] const std::optional<analysis::FrictionCurve>& friction_curve() const noexcept {
    return friction_curve_;
  }
  /// Why the run ended; `none` while it goes on. A complete sequence that meant to stop and did not is
  /// `braking_without_stop`. Like `outcome` for after the run: the real-time thread writes the same data.
  [[nodiscard]] rig::Reason end_reason() const noexcept;
  [[nodiscard]] RunOutcome outcome() const;

 private:
  class SlowCycleWatch;
  Run(const Prepared& prepared, const Given& given, experiment::RunLogicParts parts);
  RunOutcome run_fast(const Poll& poll, bool own_thread);
  RunOutcome run_realtime(const Poll& poll);
  bool make_safe_now() noexcept override;
  bool have_made_safe() noexcept override;
  [[nodiscard]] bool step() noexcept;

  const Prepared& prepared_;
  bool real_time_;
  rig::RunNames names_;
  std::unique_ptr<runtime::Clock> own_clock_;
  runtime::Clock& clock_;
  std::unique_ptr<driver::RigDriver> own_driver_;
  driver::RigDriver& driver_;
  experiment::RunLogic logic_;
  std::unique_ptr<runtime::CycleLogic> outer_logic_;  ///< null: `logic_` itself
  runtime::CommandGate gate_;
  runtime::RecordRing ring_;
  std::int64_t second_offset_ns_{-1};  ///< < 0: begin at once
  runtime::CyclicExecutive executive_;
  analysis::RunMetrics metrics_;
  std::optional<analysis::FrictionCurve> friction_curve_{};
  runtime::RecordPump pump_;
  runtime::RealtimeReport realtime_{};
  runtime::RunGuard* guard_{nullptr};
  bool watch_slow_cycles_{false};
  std::unique_ptr<SlowCycleWatch> slow_cycles_{};
  std::atomic<bool> made_safe_{false};  ///< `safe_state_` is that of the run's end
  driver::IoResult safe_state_{};
  bool ran_{false};
};

/// Puts a driver that injects faults in front of another one. It waits by the clock, which outlives it.
using InjectFaults = std::unique_ptr<driver::RigDriver> (*)(std::unique_ptr<driver::RigDriver> driver,
                                                            const std::vector<config::Injection>& faults,
                                                            std::uint64_t seed, runtime::Clock& clock);
/// Runs inject faults by this, from now on (the extra `injection`). Until then a run with injected faults is refused.
void inject_by(InjectFaults inject) noexcept;

/// The driver of the settings' backend in real time, without injected faults. Throws driver::Unavailable.
[[nodiscard]] std::unique_ptr<driver::RigDriver> make_driver(const config::Settings& settings);

// ---- The summary of a run that has ended, and whole runs in virtual time that end with it.

/// What the run itself knows. What its files lost and the texts of its configuration are the caller's to add.
/// @param foreign_controller  facts of a controller from a file; null: it is not from a file
[[nodiscard]] analysis::RunSummary summarise(const Run& run, const RunOutcome& outcome,
                                             const nlohmann::ordered_json& foreign_controller = {});

/// Throws config::ConfigError unless these settings are one run that can be made in virtual time.
void require_simulated(const config::Settings& settings, const config::Script& script);

/// A run in virtual time that left its records in the caller's sinks.
struct Simulation {
  rig::RunNames names{};
  analysis::RunSummary summary{};
};

/// Runs an experiment on the simulated rig in virtual time, in the calling thread: the records are those of
/// `abs_hil --fast` with the same settings. It writes no file and no message.
/// @param sinks  get every record, in this order
/// @param poll  called every second of virtual time; a reason other than `none` ends the run in order
/// Throws config::ConfigError and std::invalid_argument for settings that cannot be used.
[[nodiscard]] Simulation simulate(const config::Settings& settings, const config::Script& script,
                                  const std::vector<rig::RecordSink*>& sinks, const Run::Poll& poll);

}  // namespace abs_hil::run
