#include "report/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ostream>

#include "report/csv_reader.hpp"
#include "report/input_error.hpp"
#include "report/mat_file.hpp"
#include "report/run_files.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

constexpr std::string_view phase_column = "phase";

/// Columns that all runs share, in the order of the first run.
std::vector<std::string> shared_columns(const std::vector<RunFiles>& runs) {
  std::vector<std::string> shared = CsvReader(runs.front().csv).columns();
  for (std::size_t r = 1; r < runs.size(); ++r) {
    const CsvReader csv(runs[r].csv);
    std::erase_if(shared, [&](const std::string& column) { return !csv.find(column); });
  }
  return shared;
}

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

std::string number(double value, std::string_view unknown) {
  return std::isfinite(value) ? fmt::format("{}", value) : std::string(unknown);
}

std::vector<std::size_t> places_of(const CsvReader& csv, const std::vector<std::string>& columns) {
  std::vector<std::size_t> places;
  places.reserve(columns.size());
  for (const std::string& column : columns) places.push_back(csv.column(column));
  return places;
}

void note_truncation(const CsvReader& csv, std::vector<std::string>& notes) {
  if (csv.truncated()) {
    notes.push_back(
        fmt::format("{}: the last row is incomplete, as after a crash, and is left out", csv.path().string()));
  }
}

void write_csv(const std::vector<RunFiles>& runs, const std::vector<std::string>& columns, std::ostream& out,
               std::vector<std::string>& notes) {
  out << "run";
  for (const std::string& column : columns) out << ',' << quoted(column);
  out << '\n';
  std::string row;
  for (const RunFiles& run : runs) {
    CsvReader csv(run.csv);
    const std::vector<std::size_t> places = places_of(csv, columns);
    const std::string name = quoted(run.name);
    while (csv.next()) {
      row = name;
      for (std::size_t i = 0; i < columns.size(); ++i) {
        row += ',';
        row += columns[i] == phase_column ? quoted(clean_text(csv.phase())) : number(csv.values()[places[i]], "NaN");
      }
      out << row << '\n';
    }
    note_truncation(csv, notes);
  }
}

/// A run's rows by column.
struct Columns {
  std::vector<std::vector<double>> values{};  ///< for `phase`: index into `phases`, from 1
  std::vector<std::string> phases{};          ///< in the order in which they occur
};

Columns read_columns(const RunFiles& run, const std::vector<std::string>& columns, std::vector<std::string>& notes) {
  CsvReader csv(run.csv);
  const std::vector<std::size_t> places = places_of(csv, columns);
  Columns read;
  read.values.resize(columns.size());
  while (csv.next()) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      double value = csv.values()[places[i]];
      if (columns[i] == phase_column) {
        const std::string phase = clean_text(csv.phase());
        auto found = std::find(read.phases.begin(), read.phases.end(), phase);
        if (found == read.phases.end()) found = read.phases.insert(found, phase);
        value = static_cast<double>(found - read.phases.begin() + 1);
      }
      read.values[i].push_back(value);
    }
  }
  note_truncation(csv, notes);
  return read;
}

void write_json(const std::vector<RunFiles>& runs, const std::vector<std::string>& columns, std::ostream& out,
                std::vector<std::string>& notes) {
  const auto text = [](const std::string& value) { return nlohmann::json(value).dump(); };
  out << "{\"runs\": [";
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Columns read = read_columns(runs[r], columns, notes);
    out << (r > 0 ? ",\n" : "\n") << "{\"name\": " << text(runs[r].name) << ", \"label\": " << text(runs[r].label)
        << ",\n\"summary\": " << runs[r].summary.dump() << ",\n\"columns\": {";
    for (std::size_t i = 0; i < columns.size(); ++i) {
      out << (i > 0 ? ",\n" : "\n") << text(columns[i]) << ": [";
      for (std::size_t n = 0; n < read.values[i].size(); ++n) {
        if (n > 0) out << ',';
        const double value = read.values[i][n];
        if (columns[i] == phase_column) {
          out << text(read.phases[static_cast<std::size_t>(value) - 1]);
        } else {
          out << number(value, "null");
        }
      }
      out << ']';
    }
    out << "}}";
  }
  out << "\n]}\n";
}

void write_octave(const std::vector<RunFiles>& runs, const std::vector<std::string>& columns, std::ostream& out,
                  std::vector<std::string>& notes) {
  std::vector<std::string> names{"name", "label", "controller", "plant", "result", "phase_names"};
  for (const std::string& column : columns) names.push_back(mat::field_name(column));
  std::vector<std::string> fields;
  for (const RunFiles& run : runs) {
    const Columns read = read_columns(run, columns, notes);
    for (const std::string& value :
         {run.name, run.label, run.text("controller"), run.text("plant"), run.text("result")}) {
      fields.push_back(mat::text("", value));
    }
    fields.push_back(mat::texts("", read.phases));
    for (const std::vector<double>& values : read.values) fields.push_back(mat::column("", values));
  }
  out << mat::header() << mat::structs("runs", names, fields);
}

}  // namespace

std::vector<std::string> export_runs(const ExportOptions& options, std::ostream& out) {
  const FoundRuns found = find_runs(options.runs, options.labels);
  const std::vector<std::string> columns = options.columns.empty() ? shared_columns(found.runs) : options.columns;
  std::vector<std::string> notes = found.notes;
  switch (options.format) {
    case ExportFormat::csv: write_csv(found.runs, columns, out, notes); break;
    case ExportFormat::json: write_json(found.runs, columns, out, notes); break;
    case ExportFormat::octave: write_octave(found.runs, columns, out, notes); break;
  }
  return notes;
}

}  // namespace abs_hil::report
