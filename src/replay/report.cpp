// The report of a replay: recorded and replayed figures side by side.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "replay/replay.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::replay {

namespace {

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
