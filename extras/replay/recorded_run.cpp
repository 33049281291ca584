// Reads a recorded run from its event log, with the settings that it had.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "replay/replay.hpp"
#include "rig/parse_json.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::replay {

namespace {

using telemetry::RecordingError;

/// Longer than any cycle that goes on; with it, sums of times stay within their type.
constexpr std::int64_t longest_read_ns = 3'600'000'000'000;

/// Collects a recording's events into a run and checks each of them.
class Collector {
 public:
  explicit Collector(std::string name) : name_(std::move(name)) {}

  void take(const telemetry::LogEvent& event) {
    const std::int64_t fingerprint = telemetry::fingerprint_of(event.data);
    const auto is = [fingerprint]<class Message>(const Message&) {
      return fingerprint == static_cast<std::int64_t>(Message::getHash());
    };
    if (is(telemetry_t{})) {
      take_cycle(decoded<telemetry_t>(event), event.channel);
    } else if (is(experiment_t{})) {
      take_experiment(decoded<experiment_t>(event));
    } else if (is(event_t{})) {
      run_.events.push_back(decoded<event_t>(event));
    } else if (is(adjustment_t{})) {
      run_.adjustments.push_back(decoded<adjustment_t>(event));
    } else if (is(status_t{})) {
      static_cast<void>(decoded<status_t>(event));
    } else if (event.channel == channel_ || event.channel.ends_with("TELEMETRY")) {
      fail("event " + std::to_string(event.number) + " on " + event.channel +
           " is not a telemetry_t of this version of abs_hil; replay it with the version that recorded it");
    }
  }

  RecordedRun finish(std::string cut) {
    run_.cut = std::move(cut);
    if (run_.cycles.empty()) fail("it holds no telemetry of abs_hil (no telemetry_t message)");
    if (!has_experiment_) {
      fail("it holds no configuration (no experiment_t message); record with --log, or for more than 5 s");
    }
    if (const auto lacking = telemetry::lacking_in(run_.cycles.front()); !lacking.empty()) {
      run_.cut.append(run_.cut.empty() ? "" : "; ").append("'" + name_ + "' lacks ").append(lacking.front());
      run_.cut.append(", as another version recorded it: it counts as unknown");
    }
    for (std::size_t n = 1; n < run_.adjustments.size(); ++n) {
      if (run_.adjustments[n].cycle < run_.adjustments[n - 1].cycle)
        fail("the adjustments are out of order; the recording is damaged");
    }
    run_.virtual_time = std::all_of(run_.cycles.begin(), run_.cycles.end(), [](const telemetry_t& cycle) {
      return cycle.wakeup_latency_ns == 0 && cycle.cycle_ns == 0 && cycle.record_ns == 0;
    });
    return std::move(run_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw RecordingError("'" + name_ + "': " + what); }

  template <class Message>
  Message decoded(const telemetry::LogEvent& event) {
    Message message{};
    const std::string_view problem = telemetry::decode_checked(event.data, message);
    if (!problem.empty()) {
      fail("event " + std::to_string(event.number) + " on " + event.channel + ": " + std::string(problem));
    }
    return message;
  }

  void take_cycle(telemetry_t cycle, const std::string& channel) {
    if (channel_.empty()) channel_ = channel;
    const auto expected = static_cast<std::int64_t>(run_.cycles.size());
    if (cycle.cycle != expected) fail(gap(expected, cycle));
    if (cycle.phase < telemetry_t::PHASE_IDLE || cycle.phase > telemetry_t::PHASE_FAULT) {
      fail("cycle " + std::to_string(cycle.cycle) + " is damaged: phase " + std::to_string(cycle.phase));
    }
    if (!run_.cycles.empty() && cycle.stamp_ns < run_.cycles.back().stamp_ns) {
      fail("cycle " + std::to_string(cycle.cycle) +
           " is damaged: its time stamp is earlier than that of the previous cycle");
    }
    if (cycle.read_ns < 0 || cycle.read_ns > longest_read_ns) {
      fail("cycle " + std::to_string(cycle.cycle) + " is damaged: its reading took " + std::to_string(cycle.read_ns) +
           " ns");
    }
    run_.cycles.push_back(cycle);
  }

  [[nodiscard]] std::string gap(std::int64_t expected, const telemetry_t& found) const {
    const std::string where =
        "cycle " + std::to_string(found.cycle) + " follows where cycle " + std::to_string(expected) + " is expected: ";
    if (expected == 0) return where + "a replay needs the run from its first cycle";
    if (found.sequence == expected) {
      return where +
             "not every cycle was published (telemetry.decimation, or drops); record with --log and "
             "telemetry.decimation=1";
    }
    return where + "messages are missing or damaged; record with --log, which loses none";
  }

  void take_experiment(const experiment_t& experiment) {
    if (!has_experiment_) run_.experiment = experiment;
    has_experiment_ = true;
    const experiment_t& first = run_.experiment;
    if (experiment.config_json != first.config_json || experiment.controller != first.controller ||
        experiment.backend != first.backend || experiment.plant != first.plant ||
        experiment.experiment != first.experiment) {
      fail("two configurations in one recording (message " + std::to_string(experiment.sequence) +
           " on the experiment's channel); the recording is damaged or holds more than one run");
    }
  }

  std::string name_;
  std::string channel_;  ///< telemetry channel
  RecordedRun run_{};
  bool has_experiment_{false};
};

}  // namespace

RecordedRun read_run(const std::string& recording) {
  const telemetry::NamedRecording named(recording);
  telemetry::RunSeparator all, runs;
  telemetry::for_each_event(named.path, [&all](const telemetry::LogEvent& event) { all.run_of(event); });
  const std::size_t chosen = chosen_run(named, all.runs());
  Collector collector(named.path);
  return collector.finish(telemetry::for_each_event(named.path, [&](const telemetry::LogEvent& event) {
    if (runs.run_of(event) == chosen) collector.take(event);
  }));
}

config::Settings settings_of(const RecordedRun& run, const Changes& changes) {
  config::Settings settings;
  config::KeyTable keys(settings);
  const auto config = rig::parse_json_if_valid<nlohmann::ordered_json>(run.experiment.config_json);
  if (config.is_discarded())
    throw RecordingError("the recorded configuration is not JSON, or nested too deep; the recording is damaged");
  try {
    // Unknown keys of another version are harmless as long as --check finds the same commands.
    static_cast<void>(config::load_json(config, keys, "recorded configuration"));
  } catch (const config::ConfigError& error) {
    throw RecordingError(error.what());
  }
  settings.plant_name = run.experiment.plant;
  settings.backend = run.experiment.backend;
  if (settings.on_rig()) {
    settings.model_name = settings.plant_name;
    keys.leave_out_plant();
    // Before the rig had an identity, the limits came from the model.
    if (!config.contains("rig")) settings.rig.parameters = settings.model;
  }
  if (changes.controller) keys.set_text("control.controller=" + *changes.controller, "--controller");
  for (const std::string& assignment : changes.assignments) keys.set_text(assignment, "--set");
  return settings;
}

}  // namespace abs_hil::replay
