// Files of runs: messages of an event log, and figures of merit of rows.

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "abs_hil/plant_sim/factor_profile.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/signals.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "analysis/friction_curve.hpp"
#include "analysis/run_metrics.hpp"
#include "array.hpp"
#include "bindings.hpp"
#include "column_sink.hpp"
#include "files/result_file.hpp"
#include "rig/encoder_scale.hpp"
#include "rig/formatted_text.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::python {

namespace {

/// A quantity that is no column of the CSV.
struct OtherColumn {
  std::vector<double> reals{};
  std::vector<std::int64_t> wholes{};
};

/// The rows of one run in an event log, and its other messages.
class LogColumns {
 public:
  /// @param whole  with every quantity and the events' numbers and times, not only the CSV's columns
  explicit LogColumns(bool whole) : whole_(whole) {}

  void take(const telemetry::LogEvent& event) {
    const std::int64_t fingerprint = telemetry::fingerprint_of(event.data);
    bool ours = false;
    telemetry::for_each_message_type(
        [&]<class Message>() { ours = ours || fingerprint == static_cast<std::int64_t>(Message::getHash()); });
    if (fingerprint == static_cast<std::int64_t>(telemetry_t::getHash())) {
      telemetry_t message{};
      if (telemetry::decode_checked(event.data, message).empty()) {
        take_cycle(event, message);
      } else {
        ++unreadable_;
      }
    } else if (ours) {
      messages_.emplace_back(event.data.begin(), event.data.end());
    } else if (event.channel.ends_with("TELEMETRY") || event.channel.ends_with("EXPERIMENT") ||
               event.channel.ends_with("EVENT")) {
      ++unreadable_;
    }
  }
  py::dict result() {
    py::dict result;
    result["rows"] = columns_.rows();
    py::dict columns = columns_.take({.phases = phases_, .signals = signals_});
    std::size_t n = 0;
    if (whole_) {
      rig::for_each_quantity([&](const auto& row) {
        if (row.in_csv()) return;
        const py::str name(row.name.data(), row.name.size());
        if constexpr (std::is_floating_point_v<rig::ValueOf<std::decay_t<decltype(row)>>>) {
          columns[name] = array_of(std::move(others_[n++].reals));
        } else {
          columns[name] = array_of(std::move(others_[n++].wholes));
        }
      });
      columns["log_event"] = array_of(std::move(numbers_));
      columns["log_time_us"] = array_of(std::move(times_us_));
    }
    result["columns"] = columns;
    result["signals"] = signals_;
    result["channel"] = rig::clean_text(channel_);
    result["start_us"] = start_us_;
    result["cycles"] = array_of(std::move(cycles_));
    result["sequences"] = array_of(std::move(sequences_));
    py::list messages;
    for (const std::string& message : messages_) messages.append(py::bytes(message));
    result["messages"] = messages;
    result["unreadable"] = unreadable_;
    result["late"] = late_;
    result["lacks"] = lacks_;
    return result;
  }

 private:
  void take_cycle(const telemetry::LogEvent& event, telemetry_t& message) {
    if (cycles_.empty()) {
      channel_ = event.channel;
      if (event.timestamp_us > 0) start_us_ = event.timestamp_us - std::llround(message.time_s * 1e6);
      signals_ = telemetry::signals_of(message);
      for (const std::string_view name : telemetry::lacking_in(message)) {
        lacks_.append(lacks_.empty() ? "the log lacks " : ", ").append(name);
      }
    } else if (message.cycle <= cycles_.back() && message.sequence <= sequences_.back()) {  // it comes twice, or late
      ++late_;
      return;
    }
    cycles_.push_back(message.cycle);
    sequences_.push_back(message.sequence);
    note_phase(message);
    const rig::CycleRecord record = telemetry::to_record(message);
    columns_.consume(record, message.distance_m);
    if (!whole_) return;
    const rig::CycleParts<const rig::CycleRecord> parts{record, message.distance_m, message.sequence};
    std::size_t n = 0;
    rig::for_each_quantity([&](const auto& row) {
      if (row.in_csv()) return;
      OtherColumn& other = others_[n++];
      if constexpr (std::is_floating_point_v<rig::ValueOf<std::decay_t<decltype(row)>>>) {
        other.reals.push_back(row.at(parts));
      } else {
        other.wholes.push_back(static_cast<std::int64_t>(row.at(parts)));
      }
    });
    numbers_.push_back(event.number);
    times_us_.push_back(event.timestamp_us);
  }
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

  bool whole_;
  ColumnSink columns_;
  std::array<OtherColumn, rig::quantity_count - rig::csv_columns.size()> others_{};
  std::vector<std::int64_t> numbers_;
  std::vector<std::int64_t> times_us_;
  std::vector<std::int64_t> cycles_;
  std::vector<std::int64_t> sequences_;
  std::vector<std::string> messages_;
  std::string channel_;
  std::int64_t start_us_{0};
  std::vector<rig::NamedPhase> phases_;
  std::vector<std::string> signals_;
  std::string lacks_;
  std::size_t unreadable_{0};
  std::size_t late_{0};
};

/// One run of an event log, by its number from 0: rows (their number), columns, signals, channel, start_us (Unix time),
/// cycles and sequences (of the rows), messages (the run's others, encoded), unreadable and late (numbers of messages),
/// lacks (quantities of this version); and of the log: runs, parts (appended recordings), damage (why the rest is not
/// read). Texts are empty if there is nothing to say.
py::dict read_log(const std::string& path, std::size_t run, bool whole) {
  LogColumns columns(whole);
  telemetry::RunSeparator separator;
  std::size_t parts = 0;
  std::string damage;
  {
    const py::gil_scoped_release release;
    telemetry::EventLogReader log(path);
    try {
      while (const auto event = log.next()) {
        parts = event->part + 1;
        if (separator.run_of(*event) == run) columns.take(*event);
      }
      damage = log.cut();
    } catch (const telemetry::RecordingError& error) {
      damage = error.what();
    }
  }
  py::dict result = columns.result();
  result["runs"] = separator.runs();
  result["parts"] = parts;
  result["damage"] = damage;
  return result;
}

/// The events of a log, one after the other: (run, part, number, time in us, channel, data). `cut` as of the reader.
class LogEvents {
 public:
  explicit LogEvents(const std::string& path) : log_(path) {}
  py::tuple next() {
    const auto event = log_.next();
    if (!event) throw py::stop_iteration();
    const auto& data = event->data;
    return py::make_tuple(runs_.run_of(*event), event->part, event->number, event->timestamp_us,
                          rig::clean_text(event->channel),
                          py::bytes(reinterpret_cast<const char*>(data.data()), data.size()));
  }
  [[nodiscard]] const std::string& cut() const { return log_.cut(); }

 private:
  telemetry::EventLogReader log_;
  telemetry::RunSeparator runs_;
};

/// Writes a result as the program does. `write` gets the name of the file to fill, or an empty one for a stream, and
/// returns bytes to append.
void write_result(const std::string& path, const py::function& write, bool probe) {
  files::ResultFile file(path, "file");
  const std::string bytes = py::cast<py::bytes>(write(py::bytes(file.part().string())));
  if (!probe) file.write(bytes);
}

using Column = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// (slip, force in N) in the middle of a window of 60 ms; None where it cannot be known.
/// @param samples  (rows, 3): time_s, and the counts of the upper and the lower wheel, which wrap around at 32 bit
/// @param parameters  r1_m, r2_m, J2_kg_m2, d2_Nms_rad, M20_Nm
std::optional<std::pair<double, double>> friction_point(const Column& samples, const std::array<double, 5>& parameters,
                                                        std::int32_t counts_per_rev) {
  const auto at = samples.unchecked<2>();
  std::vector<analysis::EncoderSample> window;
  std::array<std::int32_t, 2> last{};
  for (py::ssize_t n = 0; n < at.shape(0); ++n) {
    const auto counts = [&](int column) { return static_cast<std::int32_t>(static_cast<std::int64_t>(at(n, column))); };
    const std::array now{counts(1), counts(2)};
    const analysis::EncoderSample before = window.empty() ? analysis::EncoderSample{0.0, 0, 0} : window.back();
    if (window.empty()) last = now;
    window.push_back({at(n, 0), before.upper + rig::counts_between(last[0], now[0]),
                      before.lower + rig::counts_between(last[1], now[1])});
    last = now;
  }
  rig::WheelParameters wheels;
  wheels.r1_m = parameters[0];
  wheels.r2_m = parameters[1];
  wheels.J2_kg_m2 = parameters[2];
  wheels.d2_Nms_rad = parameters[3];
  wheels.M20_Nm = parameters[4];
  if (window.empty() || counts_per_rev <= 0 || !(wheels.r2_m > 0.0)) return std::nullopt;
  const analysis::EncoderSample middle{0.5 * (window.front().time_s + window.back().time_s), 0, 0};
  const auto point = analysis::friction_point(window, middle, wheels, rig::radians_per_count(counts_per_rev));
  return point ? std::optional(std::pair(point->slip, point->force_N)) : std::nullopt;
}

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

/// Rows of CSV from columns: arrays of numbers, whole ones if they are so, or lists of texts.
py::bytes csv_rows(const py::list& columns) {
  using Wholes = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
  std::vector<std::variant<Column, Wholes, std::vector<std::string>>> all_columns;
  std::size_t rows = 0;
  for (const py::handle column : columns) {
    rows = py::len(column);
    if (py::isinstance<py::list>(column)) {
      all_columns.emplace_back(py::cast<std::vector<std::string>>(column));
    } else if (py::cast<py::array>(column).dtype().kind() == 'i') {
      all_columns.emplace_back(py::cast<Wholes>(column));
    } else {
      all_columns.emplace_back(py::cast<Column>(column));
    }
  }
  std::string all;
  const auto add = [&all](const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, double>) {
      all += telemetry::csv_number(value);
    } else if constexpr (std::is_integral_v<Value>) {
      all += std::to_string(value);
    } else {
      all += rig::csv_field(value);
    }
  };
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < all_columns.size(); ++c) {
      if (c > 0) all += ',';
      std::visit([&](const auto& values) { add(values.at(r)); }, all_columns[c]);
    }
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
  module.def("read_log", &read_log, py::arg("path"), py::arg("run"), py::arg("whole"));
  py::class_<LogEvents>(module, "LogEvents")
      .def(py::init<const std::string&>(), py::arg("path"))
      .def("__iter__", [](LogEvents& events) -> LogEvents& { return events; })
      .def("__next__", &LogEvents::next)
      .def_property_readonly("cut", &LogEvents::cut);
  module.def(
      "named_recording",
      [](const std::string& name) {
        const telemetry::NamedRecording named(name);
        return py::make_tuple(py::bytes(named.path), named.run);
      },
      py::arg("name"));
  module.def(
      "chosen_run",
      [](const std::string& name, std::size_t runs) { return chosen_run(telemetry::NamedRecording(name), runs); },
      py::arg("name"), py::arg("runs"));
  module.def("friction_point", &friction_point);
  module.attr("FRICTION_HALF_WINDOW_S") = analysis::friction_half_window_s;
  module.def("metrics_of", &metrics_of, py::arg("columns"), py::arg("r2_m"), py::arg("end_speed_m_s"));
  module.def("csv_rows", &csv_rows, py::arg("columns"));
  module.def("profile_of", &profile_of, py::arg("text"), py::arg("key"));
  module.def(
      "clean_text",
      [](const py::bytes& text, std::size_t most) { return rig::clean_text(static_cast<std::string>(text), most); },
      py::arg("text"), py::arg("most_characters") = 200);
  module.def("is_signal_name", [](const std::string& name) { return rig::is_signal_name(name); });
  module.def(
      "student_quantile",
      [](double probability, double degrees) {
        return boost::math::quantile(boost::math::students_t(degrees), probability);
      },
      py::arg("probability"), py::arg("degrees"));
}

}  // namespace abs_hil::python
