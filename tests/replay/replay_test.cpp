// Runs recorded by the program's own parts: replayed, checked, and damaged.
#include "replay/replay.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

#include "catch.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/injection.hpp"
#include "config/plan.hpp"
#include "experiment/simulated_run.hpp"
#include "injection/injecting_driver.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::replay {
namespace {

using abs_hil::test::TemporaryFolder;

/// A run to record: key=value assignments, and whether a stop request ends it.
struct Recipe {
  std::vector<std::string> assignments{};
  std::uint32_t decimation{1};
  rig::Reason stop{rig::Reason::none};
  std::int64_t measured_late_ns{0};  ///< like a board that reads its counters after the wake-up
  std::int64_t read_ns{0};           ///< duration of each reading as written into the log
  int loses_every{0};                ///< a board that ignores every Nth command; 0: a simulated rig
};

/// Like a board that takes a command now and then not, and goes on with the one before.
class LosesCommands final : public driver::RigDriver {
 public:
  LosesCommands(std::unique_ptr<driver::RigDriver> rig, int every) : rig_(std::move(rig)), every_(every) {}
  ~LosesCommands() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return rig_->name(); }
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept override {
    return rig_->as_sent(command);
  }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override {
    return every_ == 0 ? rig_->truth() : rig::PlantTruth{};  // a board knows none
  }

 private:
  void do_configure() override { rig_->configure(); }
  void do_activate(std::int64_t now_ns) override { rig_->activate(now_ns); }
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    return rig_->read(now_ns, measurement);
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = last_;
    if (every_ != 0 && ++writes_ % every_ == 0) return {};
    const driver::IoResult result = rig_->write(command, sent);
    last_ = sent;
    return result;
  }
  driver::IoResult do_make_safe() noexcept override { return rig_->deactivate(); }

  std::unique_ptr<driver::RigDriver> rig_;
  int every_;
  int writes_{0};
  rig::Command last_{};
};

/// Passes records on with a later time of measurement, like a board.
class LateMeasurement final : public rig::RecordSink {
 public:
  LateMeasurement(rig::RecordSink& next, const Recipe& recipe)
      : next_(next), late_ns_(recipe.measured_late_ns), read_ns_(recipe.read_ns) {}
  void consume(const rig::CycleRecord& record, double distance_m) override {
    rig::CycleRecord late = record;
    late.measurement.time_ns += late_ns_;
    late.timing.read_ns += read_ns_;
    next_.consume(late, distance_m);
  }
  void finish() override { next_.finish(); }

 private:
  rig::RecordSink& next_;
  std::int64_t late_ns_;
  std::int64_t read_ns_;
};

void record_run(const std::filesystem::path& path, const Recipe& recipe) {
  config::Settings s;
  config::KeyTable keys(s);
  config::load_file(config::plant_file(s.plant_name), keys, config::Tables::of_plant);
  keys.set_text("experiment.start_speed_rad_s=100", "test");
  for (const std::string& assignment : recipe.assignments) keys.set_text(assignment, "test");
  if (recipe.loses_every != 0) {
    s.backend = "rig";
    s.model = s.plant.rig;
    keys.leave_out_plant();
  }
  const run::Prepared prepared(s);
  telemetry::LogOutlet log(path, 0);
  telemetry::MessageStream stream(
      {.telemetry_every_cycles = recipe.decimation},
      {{0, 0, s.experiment.name, s.control.controller, s.plant_name, s.backend, keys.to_json().dump(), "test"},
       prepared.logic_parts(s.plant).names},
      {});
  stream.add(log);
  LateMeasurement late(stream, recipe);
  runtime::VirtualClock clock;
  injection::InjectingDriver driver(
      std::make_unique<LosesCommands>(
          std::make_unique<driver::SimDriver>(
              s.plant, driver::SimStart{.seed = static_cast<std::uint64_t>(s.seed),
                                        .start_speed_rad_s = s.experiment.start_speed_rad_s,
                                        .pwm_mode = driver::pwm_mode_named(s.driver.sim.pwm_mode)}),
          recipe.loses_every),
      config::parse_injections(s.inject), static_cast<std::uint64_t>(s.seed),
      [&clock](std::int64_t duration_ns) { clock.sleep_until(clock.now_ns() + duration_ns); });
  run::Run run(prepared, {.clock = &clock, .driver = &driver});
  run.record_into({&late});
  run.go([&recipe] { return recipe.stop; });
}

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST_CASE("a recorded run is reproduced bit by bit with any controller and rate") {
  const TemporaryFolder scratch;
  for (const char* controller :
       {"adaptive", "adaptive-actuator", "adaptive-optimal", "adaptive-peak", "adaptive-predictor", "nominal",
        "sliding-mode", "sliding-mode-smooth", "super-twisting", "pi", "mixed-slip-deceleration", "braking-stiffness",
        "relay", "five-phase", "locked"}) {
    INFO(controller);
    record_run(scratch / "run.lcmlog", {{std::string("control.controller=") + controller, "control.rate_Hz=700"}});
    const RecordedRun run = read_run(scratch / "run.lcmlog");
    CHECK(run.virtual_time);
    const CheckResult result = check(run);
    CHECK(result.equal);
    CHECK(result.lines.size() == 2);
  }
}

TEST_CASE("a log from before a quantity is reproduced in what it has, and a changed value of its is found") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {{"control.controller=adaptive"}});
  RecordedRun run = read_run(scratch / "run.lcmlog");
  const std::string later = "upper_edge_age_ns,lower_edge_age_ns,";
  for (telemetry_t& message : run.cycles) {
    REQUIRE(message.names.starts_with(later));
    message.names.erase(0, later.size());
    message.values.erase(message.values.begin(), message.values.begin() + 2);
    message.value_count -= 2;
  }
  CHECK(check(run).equal);
  const auto braking = std::ranges::find_if(
      run.cycles, [](const telemetry_t& m) { return !m.values.empty() && std::isfinite(m.values.back()); });
  REQUIRE(braking != run.cycles.end());
  braking->values.back() += 1.0;
  CHECK_FALSE(check(run).equal);
}

TEST_CASE("runs with ideal sensors, ideal actuator, faults and stop requests are reproduced") {
  const TemporaryFolder scratch;
  const std::vector<Recipe> recipes{
      {{"plant.ideal_sensors=true", "plant.ideal_actuator=true"}},
      {{"plant.ideal_actuator=true"}},
      {{"driver.sim.pwm_mode=8-bit", "plant.u0=0.55", "gate.brake_rate_per_s=1"}},
      {{"experiment.brake_limit_s=0.5"}},                                   // phase_time_limit
      {{"gate.overspeed_rad_s=99"}},                                        // overspeed, found by the gate
      {{"experiment.brake_limit_s=30"}, 1, rig::Reason::interrupt_signal},  // from outside, after 1000 cycles
      {{"experiment.brake_limit_s=30", "experiment.stop_brake_duty=0.5"}, 1, rig::Reason::interrupt_signal},
      {{"plant.friction_profile=braking time: 1; 0.5 at 0.3"}},
      {{"plant.brake_dead_time_s=0.0129", "plant.brake_release_lead_s=0.0037", "plant.brake_overshoot=0.7",
        "plant.brake_ripple_Nm=1.5", "plant.motor_start_torque_Nm=1", "plant.motor_start_until_rad_s=105"}},
  };
  for (const Recipe& recipe : recipes) {
    INFO(recipe.assignments.front());
    record_run(scratch / "run.lcmlog", recipe);
    const CheckResult result = check(read_run(scratch / "run.lcmlog"));
    INFO(result.lines.back());
    CHECK(result.equal);
  }
}

TEST_CASE("runs on a board that did not take every command are reproduced") {
  const TemporaryFolder scratch;
  for (const char* controller : {"adaptive", "pi", "sliding-mode"}) {
    INFO(controller);
    record_run(scratch / "run.lcmlog",
               {.assignments = {std::string("control.controller=") + controller, "gate.brake_duty_max=0.7"},
                .loses_every = 5});
    const RecordedRun run = read_run(scratch / "run.lcmlog");
    CHECK(run.cycles.size() > 500);
    const CheckResult result = check(run);
    INFO(result.lines.front());
    CHECK(result.equal);
  }
}

TEST_CASE("every fault that the gate finds in the wheels is reproduced") {
  const TemporaryFolder scratch;
  const std::vector<std::pair<const char*, rig::Reason>> faults{
      {"brake@encoder_upper:stuck+0.1s", rig::Reason::encoder_upper_stuck},
      {"coast@encoder_lower:stuck", rig::Reason::encoder_lower_stuck},
      {"brake@encoder_upper:garbage+0.1s", rig::Reason::encoder_upper_jumped},  // refused: not in the recording
      {"brake@encoder_lower:garbage+0.1s", rig::Reason::encoder_lower_jumped},
      {"coast@encoder_upper:wrong+0.1s", rig::Reason::encoder_upper_reversed},
      {"coast@encoder_lower:wrong+0.1s", rig::Reason::encoder_lower_reversed},
      {"coast@encoders:stuck+0.1s", rig::Reason::encoders_lost},
      {"accelerate@encoder_upper:slow+0.1s", rig::Reason::encoder_upper_jumped},
      {"brake@encoders:wrong", rig::Reason::encoder_lower_jumped},
      {"brake@read:stuck+0.1s", rig::Reason::samples_missing},
      {"accelerate@stamp:off+0.1s", rig::Reason::samples_missing},
      {"brake@stamp:intermittent+0.1s", rig::Reason::sequence_complete},  // measurements refused on the way
      {"brake@read:slow=0.9ms,brake@encoder_upper:garbage+0.1s", rig::Reason::encoder_upper_jumped},
      // Slow readings make the speed windows longer: without the recorded durations the fault would be found earlier.
      {"brake@read:slow=0.9ms,brake@encoder_lower:stuck+0.1s", rig::Reason::encoder_lower_stuck},
      {"accelerate@write:stuck+1s", rig::Reason::speed_rises_with_motor_off},
      {"accelerate@motor_pwm:off+0.1s", rig::Reason::motor_no_response},
      {"brake@brake_pwm:off", rig::Reason::brake_no_response},
  };
  for (const auto& [fault, reason] : faults) {
    for (const bool ideal_sensors : {false, true}) {
      INFO(fault << (ideal_sensors ? ", ideal sensors" : ""));
      record_run(scratch / "run.lcmlog", {{"experiment.start_speed_rad_s=0", std::string("run.inject=") + fault,
                                           std::string("plant.ideal_sensors=") + (ideal_sensors ? "true" : "false")}});
      const RecordedRun run = read_run(scratch / "run.lcmlog");
      // A failing encoder's ideal speed may jump before its counts show it.
      if (!ideal_sensors) CHECK(run.cycles.back().reason == static_cast<int>(reason));
      const CheckResult result = check(run);
      INFO(result.lines.front());
      CHECK(result.equal);
      // The replay of another controller ends there too.
      CHECK(rerun_open_loop(run, settings_of(run, {.controller = "pi"}), WheelFaults::as_recorded).size() ==
            run.cycles.size());
    }
  }
}

TEST_CASE("a board's own time of measurement is recorded, and a replay needs it") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {.measured_late_ns = 1});
  const RecordedRun run = read_run(scratch / "run.lcmlog");
  CHECK(run.cycles[5].measured_ns == run.cycles[5].stamp_ns + 1);
  // The simulator's counters were read at the stamp: 1 ns later everywhere is the same run.
  CHECK(rerun_open_loop(run, settings_of(run), WheelFaults::found_again).size() == run.cycles.size());
}

TEST_CASE("any changed bit of a measurement, estimate or command is found and named") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {});
  const RecordedRun whole = read_run(scratch / "run.lcmlog");
  const auto found = [&](const std::function<void(telemetry_t&)>& change) {
    RecordedRun run = whole;
    change(run.cycles[400]);
    const CheckResult result = check(run);
    CHECK_FALSE(result.equal);
    return result.lines.front();
  };
  using Catch::Matchers::Contains;
  const auto next_bit = [](double& value) { value = std::nextafter(value, 1e9); };
  CHECK_THAT(found([&](telemetry_t& m) { next_bit(m.brake_pwm); }), Contains("cycle 400 ") && Contains("brake_pwm"));
  CHECK_THAT(found([&](telemetry_t& m) { next_bit(m.theta_est_N); }), Contains("theta_est_N"));
  CHECK_THAT(found([](telemetry_t& m) { ++m.upper_counts; }), Contains("omega1_est_rad_s"));
  CHECK_THAT(found([](telemetry_t& m) { m.phase = telemetry_t::PHASE_HOLD; }), Contains("phase"));
  CHECK_THAT(found([](telemetry_t& m) { m.motor_enable = 1; }), Contains("motor_enable"));
  // Durations are part of a run with --fast only: there they are 0.
  RecordedRun late = whole;
  late.cycles[400].read_ns = 7;
  CHECK_FALSE(check(late).equal);
  late.virtual_time = false;
  CHECK(check(late).equal);
  // The end is part of it.
  RecordedRun longer = whole;
  longer.cycles.push_back(longer.cycles.back());
  ++longer.cycles.back().cycle;
  CHECK_THAT(check(longer).lines.front(), Contains("the replayed run ends after"));
}

TEST_CASE("another seed, gain or controller in the configuration is found") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {});
  const RecordedRun whole = read_run(scratch / "run.lcmlog");
  const auto with = [&](const char* table, const char* key, const nlohmann::ordered_json& value) {
    RecordedRun run = whole;
    auto config = nlohmann::ordered_json::parse(run.experiment.config_json);
    config[table][key] = value;
    run.experiment.config_json = config.dump();
    return check(run);
  };
  CHECK_FALSE(with("control", "slip_ref", 0.1500001).equal);
  CHECK_FALSE(with("control", "controller", "pi").equal);
  const CheckResult seed = with("run", "seed", 2);
  CHECK_FALSE(seed.equal);
  CHECK(seed.lines[0].find("bit-equal") != std::string::npos);  // the seed does not affect the open loop
  CHECK(seed.lines[1].find("DIFFERENT") != std::string::npos);
  CHECK_THROWS_AS(with("control", "slip_ref", 2.0), telemetry::RecordingError);
}

TEST_CASE("a recorded configuration that nests without end is refused") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {});
  RecordedRun run = read_run(scratch / "run.lcmlog");
  run.experiment.config_json.clear();
  for (int i = 0; i < 100'000; ++i) run.experiment.config_json += R"({"a":)";
  run.experiment.config_json += "1" + std::string(100'000, '}');
  CHECK_THROWS_WITH(settings_of(run, {}), Catch::Matchers::Contains("nested too deep"));
}

TEST_CASE("another controller sees the same run: same measurements and estimates, other commands") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {});
  const RecordedRun run = read_run(scratch / "run.lcmlog");
  const auto rerun =
      rerun_open_loop(run, settings_of(run, {.controller = "nominal", .assignments = {"control.nominal.theta0_N=30"}}),
                      WheelFaults::as_recorded);
  REQUIRE(rerun.size() == run.cycles.size());
  double difference = 0.0;
  for (std::size_t n = 0; n < rerun.size(); ++n) {
    CHECK(rerun[n].record.control.speeds_est.omega1_rad_s == run.cycles[n].omega1_est_rad_s);
    CHECK(static_cast<int>(rerun[n].record.phase) == run.cycles[n].phase);
    // The torque that acted is that of the recorded command for every controller.
    CHECK(rerun[n].record.control.brake_torque_est_Nm == run.cycles[n].brake_torque_est_Nm);
    difference =
        std::max(difference, std::abs(rerun[n].record.control.brake_torque_ref_Nm - run.cycles[n].brake_torque_ref_Nm));
  }
  CHECK(difference > 0.5);
  const std::string text = report(run, settings_of(run, {.controller = "nominal", .assignments = {}}), rerun);
  CHECK(text.find("nominal") != std::string::npos);
  CHECK_THROWS_AS(settings_of(run, {.controller = "nosuch", .assignments = {}}), config::ConfigError);
}

TEST_CASE("recordings that do not hold the whole run are refused with the reason") {
  const TemporaryFolder scratch;
  using Catch::Matchers::Contains;
  record_run(scratch / "few.lcmlog", {.decimation = 10});
  CHECK_THROWS_WITH(read_run(scratch / "few.lcmlog"), Contains("telemetry.decimation"));
  for (const std::int64_t read_ns : {std::int64_t{-1}, std::numeric_limits<std::int64_t>::max()}) {
    record_run(scratch / "read.lcmlog", {.read_ns = read_ns});
    CHECK_THROWS_WITH(read_run(scratch / "read.lcmlog"),
                      Contains("cycle 0 is damaged: its reading took " + std::to_string(read_ns) + " ns"));
  }
  record_run(scratch / "run.lcmlog", {});
  const std::string whole = content(scratch / "run.lcmlog");
  const auto read_bytes = [&](const std::string& bytes) {
    std::ofstream(scratch / "x.lcmlog", std::ios::binary) << bytes;
    return read_run(scratch / "x.lcmlog");
  };
  CHECK(read_run(scratch / "run.lcmlog").cut.empty());
  CHECK_THAT(read_bytes(whole.substr(0, whole.size() - 20)).cut, Contains("cut off"));
  CHECK_THROWS_WITH(read_bytes(""), Contains("no telemetry"));
  CHECK_THROWS_WITH(read_bytes(whole + whole), Contains("holds 2 runs: give"));
}

TEST_CASE("one run of a recording with several is replayed by its number") {
  const TemporaryFolder scratch;
  record_run(scratch / "first.lcmlog", {});
  record_run(scratch / "second.lcmlog", {{"control.controller=pi"}});
  const std::string first = content(scratch / "first.lcmlog"), second = content(scratch / "second.lcmlog");
  const std::string both = scratch / "both.lcmlog";
  std::ofstream(both, std::ios::binary) << first.substr(0, first.size() - 20) << second;
  for (const auto& [name, controller] : {std::pair{both + "#1", "adaptive"}, std::pair{both + "#2", "pi"}}) {
    const RecordedRun run = read_run(name);
    CHECK(run.experiment.controller == controller);
    CHECK(check(run).equal);
  }
  CHECK_THROWS_WITH(read_run(both + "#3"), Catch::Matchers::Contains("has no run 3"));
}

TEST_CASE("64 random bytes anywhere give an error or a difference, never a crash, and rarely pass unnoticed") {
  const TemporaryFolder scratch;
  record_run(scratch / "run.lcmlog", {{"experiment.start_speed_rad_s=30"}});
  const std::string whole = content(scratch / "run.lcmlog");
  std::mt19937_64 generator(3);
  int unseen = 0;
  constexpr int trials = 60;
  for (int trial = 0; trial < trials; ++trial) {
    std::string bytes = whole;
    const std::size_t at = generator() % (bytes.size() - 64);
    for (std::size_t i = 0; i < 64; ++i) bytes[at + i] = static_cast<char>(generator());
    std::ofstream(scratch / "x.lcmlog", std::ios::binary) << bytes;
    try {
      if (check(read_run(scratch / "x.lcmlog")).equal) ++unseen;
    } catch (const telemetry::RecordingError&) {
    }
  }
  // Only ABS_STATUS and ABS_EVENT are not part of the comparison.
  CHECK(unseen <= trials / 20);
}

}  // namespace
}  // namespace abs_hil::replay
