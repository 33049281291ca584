// Files of runs: messages of an event log, and figures of merit of rows.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/plant_sim/factor_profile.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/signals.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "analysis/run_metrics.hpp"
#include "analysis/statistics.hpp"
#include "array.hpp"
#include "bindings.hpp"
#include "column_sink.hpp"
#include "files/result_file.hpp"
#include "rig/clean_text.hpp"
#include "rig/error_words.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/csv_text.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::python {

namespace {

/// Rows and description of the run in an event log.
class LogColumns {
 public:
  void take(const telemetry::LogEvent& event) {
    if (event.channel.ends_with("TELEMETRY")) {
      telemetry_t message{};
      if (!decode(event, message)) return;
      if (columns_.rows() == 0) {
        signals_ = telemetry::signals_of(message);
        for (const std::string_view name : telemetry::lacking_in(message)) {
          lacks_.append(lacks_.empty() ? "the log lacks " : ", ").append(name);
        }
      }
      note_phase(message);
      columns_.consume(telemetry::to_record(message), message.distance_m);
    } else if (event.channel.ends_with("EXPERIMENT") && experiment_.empty()) {
      experiment_t message{};
      if (!decode(event, message)) return;
      experiment_ = {message.experiment, message.controller, message.plant, message.backend, message.config_json};
    } else if (event.channel.ends_with("EVENT")) {
      event_t message{};
      decode(event, message);
    }
  }
  py::tuple result(const std::string& damage) {
    for (std::string& text : experiment_) {
      if (&text != &experiment_.back()) text = rig::clean_text(text);
    }
    const std::size_t rows = columns_.rows();
    // The configuration is JSON, as bytes: it may be damaged.
    py::list experiment;
    for (const std::string& text : experiment_) experiment.append(py::bytes(text));
    return py::make_tuple(columns_.take({.phases = phases_, .signals = signals_}), signals_, rows, experiment,
                          unreadable_, damage, lacks_);
  }

 private:
  /// A phase that is not planned, as after a fault, keeps the number of the one before.
  void note_phase(telemetry_t& message) {
    constexpr std::int32_t most_phases = 10'000;
    if (message.phase_name.empty() || message.phase_index < 0 || message.phase_index >= most_phases) return;
    const auto place = static_cast<std::size_t>(message.phase_index);
    if (phases_.size() <= place) phases_.resize(place + 1);
    rig::NamedPhase& named = phases_[place];
    if (named.name.empty()) {
      named = {static_cast<rig::Phase>(message.phase), rig::clean_text(message.phase_name)};
    }
  }
  template <class Message>
  bool decode(const telemetry::LogEvent& event, Message& message) {
    const bool whole = telemetry::decode_checked(event.data, message).empty();
    if (!whole) ++unreadable_;
    return whole;
  }

  ColumnSink columns_;
  std::vector<rig::NamedPhase> phases_;
  std::vector<std::string> signals_;
  std::vector<std::string> experiment_;
  std::string lacks_;
  std::size_t unreadable_{0};
};

/// (columns, signals, rows, [experiment, controller, plant, backend, configuration], number of unreadable messages,
/// what is wrong with the rest of the file; empty: nothing, what an older log lacks; empty: nothing)
py::tuple read_log(const std::string& path) {
  LogColumns columns;
  std::string damage;
  {
    const py::gil_scoped_release release;
    telemetry::EventLogReader log(path);
    try {
      while (const auto event = log.next()) columns.take(*event);
      damage = log.cut();
    } catch (const telemetry::RecordingError& error) {
      damage = error.what();
    }
  }
  return columns.result(damage);
}

/// What an event log says besides the rows of read_log: numbers of its messages, and events.
py::dict read_log_facts(const std::string& path) {
  std::vector<std::int64_t> cycles;
  std::vector<std::int64_t> sequences;
  std::vector<std::int64_t> event_sequences;
  std::int64_t start_us = 0;
  std::vector<std::pair<double, event_t>> events;
  {
    const py::gil_scoped_release release;
    telemetry::EventLogReader log(path);
    try {
      while (const auto event = log.next()) {
        telemetry_t message{};
        event_t reported{};
        if (event->channel.ends_with("TELEMETRY") && telemetry::decode_checked(event->data, message).empty()) {
          if (cycles.empty() && event->timestamp_us > 0)
            start_us = event->timestamp_us - std::llround(message.time_s * 1e6);
          cycles.push_back(message.cycle);
          sequences.push_back(message.sequence);
        } else if (event->channel.ends_with("EVENT") && telemetry::decode_checked(event->data, reported).empty()) {
          event_sequences.push_back(reported.sequence);
          events.emplace_back(reported.time_s, reported);
        }
      }
    } catch (const telemetry::RecordingError&) {  // read_log says so
    }
  }
  py::list told;
  for (const auto& [time_s, event] : events) {
    told.append(py::make_tuple(time_s, py::bytes(event.kind), event.reason, py::bytes(event.message)));
  }
  py::dict facts;
  facts["start_us"] = start_us;
  facts["cycles"] = array_of(std::move(cycles));
  facts["sequences"] = array_of(std::move(sequences));
  facts["event_sequences"] = array_of(std::move(event_sequences));
  facts["events"] = told;
  return facts;
}

/// Writes a result as the program does. `write` gets the name of the file to fill, or an empty one for a stream, and
/// returns bytes to append.
void write_result(const std::string& path, const py::function& write, bool probe) {
  files::ResultFile file(path, "file");
  const std::string bytes = py::cast<py::bytes>(write(py::bytes(file.part().string())));
  if (!probe) file.write(bytes);
}

using Column = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// The figures of merit of rows, as a run's summary has them.
/// @param columns  a column for each name below, of equal length; `braking` is 1 in phase brake
py::dict metrics_of(const py::dict& columns, double r2_m, double end_speed_m_s) {
  static constexpr std::array names{
      "time_s",   "braking",  "omega1_rad_s",        "omega2_rad_s", "omega1_est_rad_s", "omega2_est_rad_s", "slip",
      "slip_est", "slip_ref", "brake_torque_ref_Nm", "theta_N",      "theta_est_N",      "distance_m"};
  std::vector<Column> arrays;
  for (const char* name : names) arrays.push_back(py::cast<Column>(columns[name]));
  const py::ssize_t rows = arrays.front().size();
  for (const Column& array : arrays) {
    if (array.ndim() != 1 || array.size() != rows)
      throw std::invalid_argument("metrics_of: give columns of equal length");
  }
  std::array<const double*, names.size()> at{};
  std::transform(arrays.begin(), arrays.end(), at.begin(), [](const Column& array) { return array.data(); });
  analysis::RunMetrics metrics(r2_m, end_speed_m_s);
  {
    const py::gil_scoped_release release;
    rig::CycleRecord r;
    for (py::ssize_t n = 0; n < rows; ++n) {
      r.time_s = at[0][n];
      r.phase = at[1][n] != 0.0 ? rig::Phase::brake : rig::Phase::idle;
      r.truth.speeds = {at[2][n], at[3][n]};
      r.control.speeds_est = {at[4][n], at[5][n]};
      r.truth.slip = at[6][n];
      r.control.slip_est = at[7][n];
      r.control.slip_ref = at[8][n];
      r.control.brake_torque_ref_Nm = at[9][n];
      r.truth.theta_N = at[10][n];
      r.control.theta_est_N = at[11][n];
      metrics.consume(r, at[12][n]);
    }
  }
  const analysis::Metrics found = metrics.metrics();
  py::dict result;
  for (const analysis::Figure& figure : analysis::figures) {
    result[py::str(figure.name.data(), figure.name.size())] = figure.of(found);
  }
  return result;
}

/// Rows of CSV from columns: arrays of numbers, or lists of texts.
py::bytes csv_rows(const py::list& columns) {
  std::vector<Column> numbers(columns.size());
  std::vector<std::vector<std::string>> texts(columns.size());
  std::size_t rows = 0;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (py::isinstance<py::list>(columns[c])) {
      texts[c] = py::cast<std::vector<std::string>>(columns[c]);
      rows = texts[c].size();
    } else {
      numbers[c] = py::cast<Column>(columns[c]);
      rows = static_cast<std::size_t>(numbers[c].size());
    }
  }
  std::string all;
  for (std::size_t r = 0; r < rows; ++r) {
    telemetry::CsvRow row;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (texts[c].empty()) {
        row({}, numbers[c].at(static_cast<py::ssize_t>(r)));
      } else {
        row.text(texts[c].at(r));
      }
    }
    all += row.row();
    all += '\n';
  }
  return all;
}

/// (axis, counted from braking, [(begin, value, slope)])
py::tuple profile_of(const std::string& text, const std::string& key) {
  const plant_sim::FactorProfile profile(text, key);
  py::list pieces;
  for (const auto& piece : profile.pieces()) pieces.append(py::make_tuple(piece.begin, piece.value, piece.slope));
  return py::make_tuple(profile.axis() == plant_sim::FactorProfile::Axis::time ? "time" : "distance",
                        profile.from_braking(), pieces);
}

}  // namespace

void add_files(py::module_& module) {
  module.def(
      "check_seal", [](const std::string& folder) { run_folder::check_seal(folder); }, py::arg("folder"));
  module.def(
      "refusal",
      [](int error, const std::string& place, const std::string& deed) {
        const rig::Deed wanted = deed == "write" ? rig::writing : deed == "read" ? rig::reading : rig::reaching;
        return rig::refusal(error, place, wanted);
      },
      py::arg("error"), py::arg("place"), py::arg("deed"));
  module.def("write_result", &write_result, py::arg("path"), py::arg("write"), py::arg("probe"));
  module.def("read_log", &read_log, py::arg("path"));
  module.def("read_log_facts", &read_log_facts, py::arg("path"));
  module.def("metrics_of", &metrics_of, py::arg("columns"), py::arg("r2_m"), py::arg("end_speed_m_s"));
  module.def("csv_rows", &csv_rows, py::arg("columns"));
  module.def("profile_of", &profile_of, py::arg("text"), py::arg("key"));
  module.def(
      "clean_text",
      [](const py::bytes& text, std::size_t most) { return rig::clean_text(static_cast<std::string>(text), most); },
      py::arg("text"), py::arg("most_characters") = 200);
  module.def("is_signal_name", [](const std::string& name) { return rig::is_signal_name(name); });
  module.def(
      "estimate_mean",
      [](const std::vector<double>& values) {
        const analysis::Estimate e = analysis::estimate_mean(values);
        return py::make_tuple(e.n, e.mean, e.standard_deviation, e.low, e.high);
      },
      py::arg("values"));
}

}  // namespace abs_hil::python
