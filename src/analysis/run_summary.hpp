#pragma once

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "analysis/run_metrics.hpp"
#include "rig/gate_counts.hpp"
#include "rig/timing_summary.hpp"

namespace abs_hil::analysis {

/// A number as JSON; null for NaN and infinity, which JSON lacks.
[[nodiscard]] inline nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

/// The contents of a run's summary.
struct RunSummary {
  std::string result;  ///< "completed", "fault" or "stopped"
  std::string reason;
  std::string controller;
  std::string plant;
  std::string backend;
  std::string experiment;
  Metrics metrics{};
  std::uint64_t cycles{0};
  std::uint64_t telemetry_drops{0};
  std::uint64_t publish_failures{0};
  std::uint64_t csv_rows_lost{0};
  bool realtime{false};      ///< every required step of the real-time set-up was obtained
  bool virtual_time{false};  ///< --fast: the timing figures do not describe this computer
  bool truth_known{false};   ///< metrics are computed from the simulator's true values, not from estimates
  rig::TimingSummary timing{};
  rig::GateCounts gate{};       ///< numbers of the command gate's interventions
  double checks_unjudged{0.0};  ///< share of the run's time in which the gate's checks could not judge the wheels
  double upper_eccentricity_rad{rig::unknown};  ///< of the encoders' discs, as learnt; NaN: nothing was learnt
  double lower_eccentricity_rad{rig::unknown};
  nlohmann::ordered_json config{};
  nlohmann::ordered_json friction_curve{};  ///< result of the experiment's analysis; null without one
  std::string model{};                      ///< name of the controllers' model; empty: the plant
  /// Where the model differs from the plant, as {"theta_N": {"model": 23, "plant": 40}}; null: the plant is unknown.
  nlohmann::ordered_json model_differences{};
  std::string model_note{};                     ///< the same in words; empty: nowhere
  nlohmann::ordered_json learnt{};              ///< keys and values for the next braking on the rig; null: nothing
  nlohmann::ordered_json foreign_controller{};  ///< facts of a controller from a file; null: it is not from a file
  double end_speed_m_s{0.0};                    ///< below this speed the car has stopped
};

/// The summary as JSON, field names as in docs/telemetry.md; NaN becomes null.
[[nodiscard]] nlohmann::ordered_json to_json(const RunSummary& summary);
/// The summary as a few lines of text.
[[nodiscard]] std::string to_text(const RunSummary& summary);

}  // namespace abs_hil::analysis
