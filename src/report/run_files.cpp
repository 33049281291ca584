#include "report/run_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <set>

#include "report/input_error.hpp"
#include "report/run_details.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t name_characters = 40;

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

/// The last part of a path, also if it ends in a slash or is ".".
std::string base_name(const fs::path& path) {
  std::error_code ignored;
  fs::path whole = fs::absolute(path, ignored).lexically_normal();
  if (!whole.has_filename()) whole = whole.parent_path();
  return clean_text((is_folder(path) ? whole.filename() : whole.stem()).string(), name_characters);
}

std::string as_text(const nlohmann::ordered_json& value) {
  return value.is_string() ? clean_text(value.get<std::string>()) : std::string();
}

/// Reads an optional side file. A broken one becomes a note, so that the run is still shown.
template <typename Read>
void read_if_there(RunFiles& run, const fs::path& path, std::string_view what, const Read& read) {
  if (!is_there(path)) {
    run.notes.push_back(fmt::format("no {}: {}", clean_text(path.filename().string()), what));
    return;
  }
  try {
    read();
  } catch (const InputError& error) {
    run.notes.push_back(fmt::format("not used: {}", clean_text(error.what(), 400)));
  }
}

void read_folder(RunFiles& run) {
  const fs::path& folder = run.folder;
  read_if_there(run, folder / "summary.json", "metrics are computed from the CSV; names and result are unknown",
                [&] { run.summary = read_json(folder / "summary.json"); });
  if (run.summary.contains("config") && run.summary["config"].is_object()) {
    run.config = flattened(run.summary["config"]);
  } else {
    read_if_there(run, folder / "config.toml", "the configuration is unknown",
                  [&] { run.config = read_toml(folder / "config.toml"); });
  }
  read_if_there(run, folder / "environment.json", "kernel, build and board are unknown",
                [&] { run.environment = flattened(read_json(folder / "environment.json")); });
  read_if_there(run, folder / "events.csv", "events are the phase changes in the CSV, without reasons",
                [&] { run.events = read_events(folder / "events.csv"); });
  const bool virtual_time = run.summary.value("virtual_time", nlohmann::ordered_json(false)) == true;
  if (!virtual_time) {
    read_if_there(run, folder / "histogram.txt", "no histograms of the cycle's timing",
                  [&] { run.histogram = read_histogram(folder / "histogram.txt"); });
  }
}

RunFiles load_run(const fs::path& path) {
  RunFiles run;
  run.name = base_name(path);
  if (is_folder(path)) {
    run.folder = path;
    run.csv = path / "run.csv";
    read_folder(run);
  } else {
    run.csv = path;
    run.notes.emplace_back(
        "only a CSV file: configuration, reasons and timing are unknown; metrics are computed from it with the paper's "
        "radius and end speed");
  }
  return run;
}

std::vector<fs::path> run_folders_of(const fs::path& series) {
  std::vector<fs::path> folders;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(series, error)) {
    std::error_code ignored;  // a dangling link is not a run
    if (entry.is_directory(ignored) && entry.path().filename().string().starts_with("run-")) {
      folders.push_back(entry.path());
    }
  }
  if (error) throw InputError(fmt::format("cannot read \"{}\": {}", series.string(), error.message()));
  std::sort(folders.begin(), folders.end());
  return folders;
}

void load_series(const fs::path& path, FoundRuns& found) {
  Series series{base_name(path), {}};
  for (const fs::path& folder : run_folders_of(path)) {
    if (!is_there(folder / "run.csv") || !is_there(folder / "summary.json")) {
      found.notes.push_back(fmt::format("{} is not complete and is left out", clean_text(folder.string())));
      continue;
    }
    series.runs.push_back(found.runs.size());
    found.runs.push_back(load_run(folder));
  }
  if (series.runs.empty()) {
    throw InputError(fmt::format(
        "\"{}\": this series folder has no complete run (as run-0001/ with run.csv and summary.json)", path.string()));
  }
  found.series.push_back(std::move(series));
}

void load(const fs::path& path, FoundRuns& found) {
  if (!is_there(path)) {
    throw InputError(
        fmt::format("\"{}\" does not exist; give a run folder, a run's CSV file or a series folder", path.string()));
  }
  if (!is_folder(path) || is_there(path / "run.csv")) {
    found.runs.push_back(load_run(path));
  } else if (is_there(path / "series.json") || !run_folders_of(path).empty()) {
    load_series(path, found);
  } else {
    throw InputError(
        fmt::format("\"{}\" is neither a run folder (no run.csv) nor a series folder (no series.json, no run-0001/)",
                    path.string()));
  }
}

void name_apart(std::vector<RunFiles>& runs) {
  std::set<std::string> used;
  for (RunFiles& run : runs) {
    const std::string name = run.name;
    for (int n = 2; !used.insert(run.name).second; ++n) run.name = fmt::format("{} ({})", name, n);
  }
}

void label(std::vector<RunFiles>& runs, const std::vector<std::string>& labels) {
  if (!labels.empty() && labels.size() != runs.size()) {
    throw InputError(fmt::format("{} labels for {} runs; give one --label for each run", labels.size(), runs.size()));
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string controller = runs[i].text("controller");
    runs[i].label = runs[i].name;
    if (!controller.empty() && runs[i].name.find(controller) == std::string::npos) runs[i].label += ": " + controller;
    if (!labels.empty()) runs[i].label = clean_text(labels[i], 2 * name_characters);
  }
}

}  // namespace

double RunFiles::number(const std::string& dotted_key) const {
  const nlohmann::ordered_json* at = &summary;
  for (std::size_t begin = 0; begin <= dotted_key.size();) {
    const std::size_t dot = std::min(dotted_key.find('.', begin), dotted_key.size());
    const std::string key = dotted_key.substr(begin, dot - begin);
    if (!at->is_object() || !at->contains(key)) return std::numeric_limits<double>::quiet_NaN();
    at = &(*at)[key];
    begin = dot + 1;
  }
  return at->is_number() ? at->get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string RunFiles::text(const std::string& key) const {
  return summary.contains(key) ? as_text(summary[key]) : std::string();
}

double RunFiles::config_number(const std::string& key, double otherwise) const {
  const auto found = config.find(key);
  if (found == config.end()) return otherwise;
  const std::string& text = found->second;
  double value = 0.0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  return parsed.ec == std::errc{} && parsed.ptr == text.data() + text.size() ? value : otherwise;
}

FoundRuns find_runs(const std::vector<fs::path>& arguments, const std::vector<std::string>& labels) {
  FoundRuns found;
  for (const fs::path& argument : arguments) load(argument, found);
  name_apart(found.runs);
  label(found.runs, labels);
  return found;
}

std::vector<std::string> differing_keys(const std::vector<RunFiles>& runs) {
  std::map<std::string, std::set<std::string>> values;
  std::map<std::string, std::size_t> holders;
  std::size_t configured = 0;
  for (const RunFiles& run : runs) {
    if (run.config.empty()) continue;
    ++configured;
    for (const auto& [key, value] : run.config) {
      values[key].insert(value);
      ++holders[key];
    }
  }
  std::vector<std::string> differing;
  for (const auto& [key, different] : values) {
    if (different.size() > 1 || holders[key] < configured) differing.push_back(key);
  }
  return differing;
}

}  // namespace abs_hil::report
