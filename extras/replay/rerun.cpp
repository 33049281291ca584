// Feeds a recorded run through the cycle's parts again, cycle by cycle.
#include <bit>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "config/config_error.hpp"
#include "config/live_settings.hpp"
#include "config/plan.hpp"
#include "replay/replay.hpp"
#include "rig/parse_json.hpp"
#include "run/run.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::replay {

namespace {

constexpr double ignored_gap_s = 1e6;

/// A clock that stands still within a cycle and moves to the recorded time of the next cycle.
class RecordedClock final : public runtime::Clock {
 public:
  explicit RecordedClock(std::int64_t start_ns) : now_ns_(start_ns) {}
  [[nodiscard]] std::int64_t now_ns() noexcept override { return now_ns_; }
  void sleep_until(std::int64_t /*time_ns*/) noexcept override {}
  void set(std::int64_t now_ns) noexcept { now_ns_ = now_ns; }

 private:
  std::int64_t now_ns_;
};

bool same_duties(const rig::Command& a, const rig::Command& b) noexcept {
  return a.motor_duty == b.motor_duty && a.brake_duty == b.brake_duty && a.motor_enable == b.motor_enable;
}

/// A rig that repeats the recorded motion. Commands do not move it. What its board made of them is repeated, too: the
/// rounding, and from the recording whether it took them at all.
class RecordedRig final : public driver::RigDriver {
 public:
  RecordedRig(const RecordedRun& run, const config::Settings& s)
      : run_(run), settings_(s), grid_(config::output_grid(s, s.plant)) {}
  ~RecordedRig() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "recorded"; }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return truth_; }

 private:
  void do_configure() override {}
  void do_activate(std::int64_t /*now_ns*/) override {}
  driver::IoResult do_read(std::int64_t /*now_ns*/, rig::Measurement& measurement) noexcept override {
    const rig::CycleRecord record = telemetry::to_record(run_.cycles[next_]);
    measurement = record.measurement;
    truth_ = record.truth;
    // With ideal sensors the simulator hands its true speeds to the controller. Fault injections may have changed them;
    // then the estimates hold what the controller received.
    if (settings_.plant.ideal_sensors) {
      measurement.ideal_speeds = settings_.inject.empty() ? truth_.speeds : record.control.speeds_est;
    }
    ++next_;
    return {};
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = grid_.as_sent(command);
    if (not_taken(next_ - 1)) {
      const double torque_Nm = sent.brake_torque_Nm;
      sent = command_at(next_ - 1);
      sent.brake_torque_Nm = torque_Nm;
    }
    return {};
  }
  [[nodiscard]] rig::Command command_at(std::size_t n) const noexcept {
    return telemetry::to_record(run_.cycles[n]).command;
  }
  /// True if the recording shows that the board may have kept its previous command in cycle `n`, or that the write
  /// failed and left the safe state.
  [[nodiscard]] bool not_taken(std::size_t n) const noexcept {
    const rig::Command recorded = command_at(n);
    if (settings_.on_rig() && n > 0 && same_duties(recorded, command_at(n - 1))) return true;
    const bool failed = n + 1 < run_.cycles.size() && ended_from_outside(run_, n + 1, WheelFaults::found_again);
    return failed && same_duties(recorded, rig::safe_command);
  }
  driver::IoResult do_make_safe() noexcept override { return {}; }

  const RecordedRun& run_;
  const config::Settings& settings_;
  driver::OutputGrid grid_;
  std::size_t next_{0};
  rig::PlantTruth truth_{};
};

/// A rig whose reading takes the recorded time: it tells the gate how certain the time stamps are.
class TimedReading final : public driver::RigDriver {
 public:
  TimedReading(driver::RigDriver& rig, const RecordedRun& run, RecordedClock& clock)
      : rig_(rig), run_(run), clock_(clock) {}
  ~TimedReading() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return rig_.name(); }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return rig_.truth(); }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return rig_.as_sent(command);
  }
  void note_wheels_apart(bool apart) noexcept override { rig_.note_wheels_apart(apart); }

 private:
  void do_configure() override { rig_.configure(); }
  void do_activate(std::int64_t now_ns) override { rig_.activate(now_ns); }
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    const driver::IoResult result = rig_.read(now_ns, measurement);
    clock_.set(now_ns + run_.cycles[next_++].read_ns);
    return result;
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    return rig_.write(command, sent);
  }
  driver::IoResult do_make_safe() noexcept override { return rig_.deactivate(); }

  driver::RigDriver& rig_;
  const RecordedRun& run_;
  RecordedClock& clock_;
  std::size_t next_{0};
};

/// The run's logic, except that the actuator model gets the recorded commands.
class RecordedActuation final : public runtime::CycleLogic {
 public:
  RecordedActuation(experiment::RunLogic& logic, const RecordedRun& run) : logic_(logic), run_(run) {}

  void wheels_judged(bool sound) noexcept override { logic_.wheels_judged(sound); }
  [[nodiscard]] rig::Command step(const rig::Measurement& measurement, runtime::RunLatch& latch,
                                  rig::CycleRecord& record) noexcept override {
    cycle_ = record.sequence;
    return logic_.step(measurement, latch, record);
  }
  void commanded(const rig::Command& command) noexcept override {
    const telemetry_t& recorded = run_.cycles[cycle_];
    rig::Command acted = telemetry::to_record(recorded).command;
    const bool same =
        std::bit_cast<std::uint64_t>(acted.brake_duty) == std::bit_cast<std::uint64_t>(command.brake_duty);
    const bool ended = recorded.phase == telemetry_t::PHASE_STOPPED || recorded.phase == telemetry_t::PHASE_FAULT;
    acted.brake_torque_Nm = same ? command.brake_torque_Nm : (ended ? 0.0 : recorded.brake_torque_ref_Nm);
    logic_.commanded(acted, command);
  }
  [[nodiscard]] bool finished() const noexcept override { return logic_.finished(); }

 private:
  experiment::RunLogic& logic_;
  const RecordedRun& run_;
  std::uint64_t cycle_{0};
};

class Collected final : public rig::RecordSink {
 public:
  void consume(const rig::CycleRecord& record, double distance_m) override { cycles.push_back({record, distance_m}); }
  std::vector<RerunCycle> cycles;
};

/// The recorded script, or, for a recording without one, the script with the recorded name.
config::Plan plan_of(const RecordedRun& run, const config::Settings& s) {
  const auto config = rig::parse_json_if_valid(run.experiment.config_json);
  if (!config.is_object() || !config.contains("experiment_script") || !config["experiment_script"].is_string()) {
    return config::plan(s);
  }
  const auto files = config.value("experiment_files", nlohmann::json::object());
  const auto read_file = [&files](const std::string& name) -> std::optional<std::string> {
    const auto file = files.find(name);
    if (file == files.end() || !file->is_string()) return std::nullopt;
    return file->get<std::string>();
  };
  return config::plan(config::parse(config["experiment_script"].get<std::string>(), "recorded script", read_file), s);
}

constexpr std::string_view start_name = "start";
constexpr std::string_view continue_name = "continue";

/// The cycle that takes a change out of the mailbox. A start command and an answer show one cycle later.
std::int64_t put_before(const adjustment_t& adjustment) {
  const bool shows_later = adjustment.name == start_name || adjustment.name == continue_name;
  return shows_later ? adjustment.cycle - 1 : adjustment.cycle;
}

void put(const adjustment_t& adjustment, config::LiveSettings& live, experiment::AdjustmentMailbox& mailbox) {
  if (adjustment.name == start_name) {
    static_cast<void>(mailbox.put({}));
    return;
  }
  if (adjustment.name == continue_name) {
    static_cast<void>(mailbox.put({.kind = experiment::Adjustment::Kind::answer}));
    return;
  }
  try {
    static_cast<void>(mailbox.put(live.set(live.resolve(adjustment.name), adjustment.value)));
  } catch (const config::ConfigError&) {
    // The replayed controller does not have this gain.
  }
}

/// Runs the recorded cycles at the recorded times.
/// @param backend  whose reading takes the recorded time
/// @param given  the rest of what the rerun does not take from the settings
std::vector<RerunCycle> rerun(const RecordedRun& run, const config::Settings& s, driver::RigDriver& backend,
                              run::Given given, WheelFaults faults) {
  config::LiveSettings live(s);
  auto adjustment = run.adjustments.begin();
  RecordedClock clock(run.cycles.front().stamp_ns);
  TimedReading rig(backend, run, clock);
  given.stepped = true;
  given.driver = &rig;
  given.clock = &clock;
  // Delays are part of the recording and not repeated, so they must not count here.
  given.overruns = {.late_max_s = ignored_gap_s, .cycle_gap_max_s = ignored_gap_s};
  const run::Prepared prepared(s, plan_of(run, s));
  run::Run again(prepared, given);
  Collected collected;
  again.record_into({&collected});
  again.begin();
  for (std::size_t n = 0; n < run.cycles.size(); ++n) {
    const telemetry_t& cycle = run.cycles[n];
    clock.set(cycle.stamp_ns);
    for (; adjustment != run.adjustments.end() && put_before(*adjustment) <= cycle.cycle; ++adjustment) {
      put(*adjustment, live, again.adjustments());
    }
    if (ended_from_outside(run, n, faults)) again.request_stop(static_cast<rig::Reason>(cycle.reason));
    if (!again.cycle()) break;
  }
  return std::move(collected.cycles);
}

}  // namespace

bool ended_from_outside(const RecordedRun& run, std::size_t n, WheelFaults faults) noexcept {
  const telemetry_t& cycle = run.cycles[n];
  const auto reason = static_cast<rig::Reason>(cycle.reason);
  if (rig::is_stop_request(reason)) return true;  // the stop brake may act first
  if (cycle.phase != telemetry_t::PHASE_STOPPED && cycle.phase != telemetry_t::PHASE_FAULT) return false;
  if (!rig::is_fault(reason)) return false;
  switch (rig::row_of(reason).found_again) {
    case rig::ReplayFinds::no: return true;
    case rig::ReplayFinds::yes: return false;
    case rig::ReplayFinds::jumped_counts:
      // The gate refuses such counts; the recording then repeats the previous cycle's counts.
      if (n > 0 && run.cycles[n].measured_ns == run.cycles[n - 1].measured_ns) return true;
      return faults == WheelFaults::as_recorded;
    case rig::ReplayFinds::wheel_checks: return faults == WheelFaults::as_recorded;
  }
  return true;
}

rig::RunNames names_of(const RecordedRun& run, const config::Settings& settings) {
  return run::Prepared(settings, plan_of(run, settings)).logic_parts(settings.plant).names;
}

std::vector<RerunCycle> rerun_open_loop(const RecordedRun& run, const config::Settings& settings, WheelFaults faults) {
  // Commands of another controller never acted, so the gate must not judge the wheels by them.
  RecordedRig rig(run, settings);
  return rerun(
      run, settings, rig,
      {.checks_wheels = faults == WheelFaults::found_again,
       .logic = [&run](experiment::RunLogic& logic) { return std::make_unique<RecordedActuation>(logic, run); }},
      faults);
}

std::vector<RerunCycle> rerun_simulation(const RecordedRun& run, const config::Settings& settings) {
  return rerun(run, settings, *run::make_driver(settings), {}, WheelFaults::found_again);
}

}  // namespace abs_hil::replay
