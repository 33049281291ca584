// Reads a recorded run from its event log, with the settings that it had, and compares it with its replay: bit by bit
// with its recomputation, in figures with another controller.

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "abs_hil/message_fields.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "replay/replay.hpp"
#include "rig/parse_json.hpp"
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

/// A field as bits for comparison and as text for messages.
struct FieldValue {
  std::uint64_t bits{};
  std::string text;
};

std::map<std::string_view, FieldValue> values_of(const telemetry_t& message) {
  const auto of = [](double value) {
    return FieldValue{std::bit_cast<std::uint64_t>(value), fmt::format("{} ({:a})", value, value)};
  };
  std::map<std::string_view, FieldValue> values;
  telemetry::visit_fields(message, [&values, &of](std::string_view name, const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if (name == "value_count") return;  // another version's messages have others; each counts by its name
    if constexpr (std::is_same_v<Value, double>) {
      values[name] = of(value);
    } else if constexpr (std::is_integral_v<Value>) {
      values[name] = {static_cast<std::uint64_t>(static_cast<std::int64_t>(value)), fmt::format("{}", value)};
    }
  });
  for (const telemetry::NamedValue& named : telemetry::values_of(message)) values[named.name] = of(named.value);
  return values;
}

/// The first field in which two messages differ in their bits; empty if there is none.
struct Difference {
  std::string field;
  std::string recorded;
  std::string computed;
};
/// @param with_timing  false: does not compare durations, which no rerun can repeat
Difference first_difference(const telemetry_t& recorded, const telemetry_t& computed, bool with_timing) {
  const auto a = values_of(recorded);
  const auto b = values_of(computed);
  Difference difference;
  // Fields are compared in the message's order: causes come before effects, except for estimates.
  const auto compare = [&](std::string_view name) {
    const bool is_timing = rig::topic_of(name) == rig::Topic::timing;
    // What one of the two lacks is another version's.
    if (!difference.field.empty() || (is_timing && !with_timing) || !a.contains(name) || !b.contains(name)) return;
    if (a.at(name).bits != b.at(name).bits) difference = {std::string(name), a.at(name).text, b.at(name).text};
  };
  telemetry::visit_fields(recorded, [&compare](std::string_view name, const auto&) { compare(name); });
  for (const telemetry::NamedValue& named : telemetry::values_of(recorded)) compare(named.name);
  return difference;
}

bool same_bits(const telemetry_t& a, const telemetry_t& b) {
  telemetry::EncodeBuffer first, second;
  const auto bytes_a = first.encode(a);
  const auto bytes_b = second.encode(b);
  return std::equal(bytes_a.begin(), bytes_a.end(), bytes_b.begin(), bytes_b.end());
}

/// Compares a rerun with the recording and adds one line about the result.
bool compare(const RecordedRun& run, const rig::RunNames& names, const std::vector<RerunCycle>& rerun, bool with_timing,
             const std::string& what, CheckResult& result) {
  const std::size_t common = std::min(run.cycles.size(), rerun.size());
  for (std::size_t n = 0; n < common; ++n) {
    const telemetry_t& recorded = run.cycles[n];
    telemetry_t computed = telemetry::to_message(rerun[n].record, rerun[n].distance_m, recorded.sequence, names);
    computed.sample_valid = recorded.sample_valid;  // a rerun gets the latest usable counts, not why
    if (ended_from_outside(run, n, WheelFaults::found_again)) computed.reason_value = recorded.reason_value;
    if (same_bits(recorded, computed)) continue;
    const Difference difference = first_difference(recorded, computed, with_timing);
    if (difference.field.empty()) continue;
    result.lines.push_back(
        fmt::format("{}: DIFFERENT from cycle {} (t = {:.6f} s) on: {} was recorded as {} but replayed as {}", what, n,
                    recorded.time_s, difference.field, difference.recorded, difference.computed));
    return false;
  }
  if (run.cycles.size() != rerun.size()) {
    result.lines.push_back(fmt::format("{}: DIFFERENT: {} cycles were recorded, but the replayed run ends after {}",
                                       what, run.cycles.size(), rerun.size()));
    return false;
  }
  result.lines.push_back(fmt::format("{}: {} cycles bit-equal", what, common));
  return true;
}

/// Statistics of the torque reference over the cycles in which both runs brake.
struct TorqueFigures {
  double mean_Nm{0.0};
  double max_Nm{0.0};
  double total_variation_Nm{0.0};
  double theta_last_N{rig::unknown};
  double last_Nm{rig::unknown};

  void add(const rig::ControlState& control) {
    const double torque_Nm = control.brake_torque_ref_Nm;
    mean_Nm += torque_Nm;
    max_Nm = std::max(max_Nm, torque_Nm);
    if (!std::isnan(last_Nm)) total_variation_Nm += std::abs(torque_Nm - last_Nm);
    last_Nm = torque_Nm;
    theta_last_N = control.theta_est_N;
  }
};

std::string row(const std::string& name, const std::string& recorded, const std::string& replayed) {
  return fmt::format("{:<34} {:>14} {:>14}\n", name, recorded, replayed);
}
std::string row(const std::string& name, double recorded, double replayed) {
  return row(name, fmt::format("{:.4f}", recorded), fmt::format("{:.4f}", replayed));
}

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

CheckResult check(const RecordedRun& run) {
  const config::Settings settings = settings_of(run);
  const rig::RunNames names = names_of(run, settings);
  CheckResult result;
  const auto compared = [&](const std::vector<RerunCycle>& rerun, bool with_timing, const std::string& what) {
    result.equal = compare(run, names, rerun, with_timing, what, result) && result.equal;
  };
  compared(rerun_open_loop(run, settings, WheelFaults::found_again), run.virtual_time,
           "open loop (commands, phases and estimates from the recorded measurements)");
  const std::string simulation = "simulation (also counts and true motion, from the seed)";
  if (run.experiment.backend != "sim") {
    result.lines.push_back(simulation + ": not possible, because the backend was " + run.experiment.backend);
  } else if (!settings.inject.empty()) {
    result.lines.push_back(simulation + ": not compared, because faults were injected (run.inject)");
  } else if (!run.virtual_time && settings.experiment.start_speed_rad_s > 0.0) {
    result.lines.push_back(simulation +
                           ": not possible, because the wheels' motion before the first cycle is not recorded "
                           "(experiment.start_speed_rad_s in real time)");
  } else {
    compared(rerun_simulation(run, settings), run.virtual_time, simulation);
  }
  return result;
}

std::string report(const RecordedRun& run, const config::Settings& replayed, const std::vector<RerunCycle>& rerun) {
  TorqueFigures before, after;
  double square_sum = 0.0, largest = 0.0, largest_at_s = 0.0;
  std::size_t braking = 0;
  for (std::size_t n = 0; n < std::min(run.cycles.size(), rerun.size()); ++n) {
    const rig::CycleRecord recorded = telemetry::to_record(run.cycles[n]);
    const rig::CycleRecord& record = rerun[n].record;
    if (recorded.phase != rig::Phase::brake || record.phase != rig::Phase::brake) continue;
    ++braking;
    before.add(recorded.control);
    after.add(record.control);
    const double difference = record.control.brake_torque_ref_Nm - recorded.control.brake_torque_ref_Nm;
    square_sum += difference * difference;
    if (std::abs(difference) > std::abs(largest)) {
      largest = difference;
      largest_at_s = recorded.time_s;
    }
  }
  std::string text = row("", "recorded", "replayed");
  text += row("controller", run.experiment.controller, replayed.control.controller);
  text += row("cycles", fmt::format("{}", run.cycles.size()), fmt::format("{}", rerun.size()));
  text += fmt::format("{:<34} {:>14}\n", "cycles braking in both", braking);
  if (braking == 0) return text + "the two runs share no cycle with slip control: nothing to compare\n";
  const auto count = static_cast<double>(braking);
  text += row("brake torque reference, mean (N m)", before.mean_Nm / count, after.mean_Nm / count);
  text += row("  largest (N m)", before.max_Nm, after.max_Nm);
  text += row("  total variation (N m)", before.total_variation_Nm, after.total_variation_Nm);
  text += row("theta estimate at the end (N)", before.theta_last_N, after.theta_last_N);
  text += fmt::format("{:<34} {:>14} {:>14.4f}\n", "difference, RMS (N m)", "", std::sqrt(square_sum / count));
  text += fmt::format("{:<34} {:>14} {:>14.4f} at {:.3f} s\n", "  largest (N m)", "", largest, largest_at_s);
  return text + "open loop: the rig moved as recorded and did not react to the replayed controller\n";
}

}  // namespace abs_hil::replay
