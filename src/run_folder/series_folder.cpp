// The index of a series' runs, and its runs' folders from .part to complete.
#include "run_folder/series_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <optional>
#include <utility>

#include "files/result_file.hpp"
#include "rig/error_words.hpp"
#include "rig/parse_json.hpp"

namespace abs_hil::run_folder {

namespace fs = std::filesystem;

namespace {

void move_to(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) {
    throw FolderError(fmt::format("cannot rename \"{}\" to \"{}\": {}", from.string(), to.string(),
                                  rig::refusal(error.value(), to.string(), rig::writing)));
  }
}

/// Text under `key`, if there is one: somebody may have damaged the file.
std::optional<std::string> text_of(const nlohmann::ordered_json& object, const char* key) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_string()) return std::nullopt;
  return object[key].get<std::string>();
}

}  // namespace

SeriesFolder::SeriesFolder(fs::path path, std::string identity, std::string title, std::vector<SeriesEntry> runs)
    : path_(std::move(path)), identity_(std::move(identity)), title_(std::move(title)), runs_(std::move(runs)) {
  std::error_code error;
  if (fs::exists(path_ / series_index, error)) {
    read_index(identity_);
    resumed_ = true;
  } else {
    RunFolder checked_and_made(path_);
    write_index();
  }
}

std::string SeriesFolder::name_of(std::size_t run) { return fmt::format("run-{:04}", run + 1); }

void SeriesFolder::read_index(const std::string& identity) {
  const fs::path index = path_ / series_index;
  std::ifstream in(index);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  const auto json = rig::parse_json_if_valid<nlohmann::ordered_json>(text);
  const auto has_status = [](const nlohmann::ordered_json& run) { return text_of(run, "status").has_value(); };
  const bool whole = text_of(json, "identity") == identity && json.contains("runs") && json["runs"].is_array() &&
                     json["runs"].size() == runs_.size() && std::ranges::all_of(json["runs"], has_status);
  if (!whole) {
    throw FolderError(
        fmt::format("--out: \"{}\" holds another series of runs (script, configuration or seeds differ, or its {} is "
                    "damaged); give "
                    "a new or empty folder",
                    path_.string(), series_index));
  }
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    // The run folders decide: a killed program may leave the index one run ahead.
    if (!fs::exists(path_ / name_of(i) / file::checksums)) continue;
    check_seal(path_ / name_of(i));
    runs_[i].status = text_of(json["runs"][i], "status").value_or("");
  }
}

void SeriesFolder::write_index() const {
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    runs.push_back(
        {{"folder", name_of(i)}, {"varied", runs_[i].varied}, {"seed", runs_[i].seed}, {"status", runs_[i].status}});
  }
  const nlohmann::ordered_json json{{"experiment", title_}, {"identity", identity_}, {"runs", std::move(runs)}};
  files::write_result(path_ / series_index, "index of the series", json.dump(2) + '\n');
}

bool SeriesFolder::done(std::size_t run) const { return status(run) != "planned"; }

std::string SeriesFolder::status(std::size_t run) const {
  const std::scoped_lock lock(mutex_);
  return runs_.at(run).status;
}

fs::path SeriesFolder::begin(std::size_t run) {
  fs::path part = path_ / (name_of(run) + ".part");
  for (const fs::path& old : {part, path_ / name_of(run)}) {
    if (!fs::exists(old)) continue;
    fs::path kept;
    for (int i = 1; kept.empty() || fs::exists(kept); ++i) {
      kept = path_ / fmt::format("{}.interrupted-{}", name_of(run), i);
    }
    move_to(old, kept);
  }
  return part;
}

bool SeriesFolder::end(std::size_t run, const std::string& status) {
  const fs::path part = path_ / (name_of(run) + ".part");
  if (!fs::exists(part / file::checksums)) return false;
  const std::scoped_lock lock(mutex_);
  runs_.at(run).status = status;
  // First: the folder alone does not tell the status of its run.
  write_index();
  move_to(part, path_ / name_of(run));
  return true;
}

}  // namespace abs_hil::run_folder
