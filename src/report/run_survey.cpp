#include "report/run_survey.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/signals.hpp"
#include "report/csv_reader.hpp"
#include "report/input_error.hpp"
#include "report/plant_changes.hpp"

namespace abs_hil::report {

namespace {

/// The paper's radius, for runs without a configuration.
constexpr double paper_r2_m = rig::WheelParameters{}.r2_m;
constexpr double default_end_speed_m_s = 0.3;

/// Restores records from rows, as far as the metrics need them.
class RecordMaker {
 public:
  explicit RecordMaker(const CsvReader& csv) {
    static constexpr std::array names{"omega1_rad_s", "omega2_rad_s", "omega1_est_rad_s", "omega2_est_rad_s",
                                      "slip",         "slip_est",     "slip_ref",         "brake_torque_ref_Nm",
                                      "theta_N",      "theta_est_N",  "distance_m"};
    static_assert(names.size() == count);
    for (std::size_t i = 0; i < count; ++i) columns_[i] = csv.column(names[i]);
  }

  [[nodiscard]] rig::CycleRecord record(const CsvReader& csv) const {
    const auto value = [&](std::size_t i) { return csv.values()[columns_[i]]; };
    rig::CycleRecord r;
    r.time_s = csv.time_s();
    r.phase = csv.phase() == "brake" ? rig::Phase::brake : rig::Phase::idle;
    r.truth.speeds = {value(0), value(1)};
    r.control.speeds_est = {value(2), value(3)};
    r.truth.slip = value(4);
    r.control.slip_est = value(5);
    r.control.slip_ref = value(6);
    r.control.brake_torque_ref_Nm = value(7);
    r.truth.theta_N = value(8);
    r.control.theta_est_N = value(9);
    return r;
  }
  [[nodiscard]] double distance_m(const CsvReader& csv) const { return csv.values()[columns_[count - 1]]; }

 private:
  static constexpr std::size_t count = 11;
  std::array<std::size_t, count> columns_{};
};

void enter_phase(RunSurvey& survey, std::string_view phase, double time_s) {
  if (!survey.phases.empty()) {
    survey.phases.back().to_s = time_s;
    if (survey.phases.back().phase == phase || survey.phases.size() == most_phases) return;
  }
  survey.phases.push_back({std::string(phase), time_s, time_s});
}

}  // namespace

bool RunSurvey::knows(std::string_view column) const {
  return std::find(known_columns.begin(), known_columns.end(), column) != known_columns.end();
}

RunSurvey survey(const RunFiles& run) {
  CsvReader csv(run.csv);
  const RecordMaker maker(csv);
  RunSurvey survey;
  survey.r2_m = run.config_number("plant.r2_m", run.config_number("model.r2_m", paper_r2_m));
  analysis::RunMetrics metrics(survey.r2_m, run.config_number("experiment.end_speed_m_s", default_end_speed_m_s));
  PlantChangeFinder plant_changes(run);
  std::vector<bool> known(csv.columns().size(), false);
  bool braking = false;
  while (csv.next()) {
    const double time_s = csv.time_s();
    if (survey.rows++ == 0) survey.from_s = time_s;
    survey.to_s = time_s;
    enter_phase(survey, csv.phase(), time_s);
    if (braking) survey.brake_to_s = time_s;
    braking = csv.phase() == "brake";
    if (braking && !survey.brakes()) survey.brake_from_s = survey.brake_to_s = time_s;
    for (std::size_t i = 0; i < known.size(); ++i) {
      if (!known[i] && !std::isnan(csv.values()[i])) known[i] = true;
    }
    const rig::CycleRecord record = maker.record(csv);
    metrics.consume(record, maker.distance_m(csv));
    plant_changes.see(time_s, braking, survey.r2_m * record.truth.speeds.omega2_rad_s);
  }
  if (survey.rows == 0) {
    throw InputError(run.csv, csv.truncated() ? 2 : 1,
                     csv.truncated() ? "the only row is incomplete: the file holds no data of the run"
                                     : "no rows after the header: the file holds no data of the run");
  }
  bool in_signals = true;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const std::string& column = csv.columns()[i];
    if (known[i]) survey.known_columns.push_back(column);
    // Signals directly follow the fixed columns. A flight record has more quantities there, and no signals.
    if (i >= rig::csv_columns.size()) in_signals = in_signals && rig::is_signal_name(column);
    if (known[i] && in_signals && i >= rig::csv_columns.size()) survey.signals.push_back(column);
  }
  survey.plant_changes = plant_changes.changes();
  survey.truncated = csv.truncated();
  survey.metrics = metrics.metrics();
  return survey;
}

}  // namespace abs_hil::report
