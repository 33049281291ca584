// Creates a run's folder, seals it with checksums, and tells on what the run depended.
#include "run_folder/run_folder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>
#include <vector>
#ifndef _WIN32
#include <sys/utsname.h>
#endif

#include "files/result_file.hpp"
#include "rig/error_words.hpp"
#include "run_folder/sha256.hpp"
#include "version/build_facts.hpp"

namespace abs_hil::run_folder {

namespace fs = std::filesystem;

namespace {

std::string processor_model() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

struct System {
  std::string host{"unknown"};
  std::string kernel{"unknown"};
  std::string machine{"unknown"};
};

System system_facts() {
#ifdef _WIN32
  const char* host = std::getenv("COMPUTERNAME");
  const char* machine = std::getenv("PROCESSOR_ARCHITECTURE");
  return {.host = host != nullptr ? host : "unknown",
          .kernel = "Windows",
          .machine = machine != nullptr ? machine : "unknown"};
#else
  utsname system{};
  if (::uname(&system) != 0) return {};
  return {system.nodename, fmt::format("{} {} {}", system.sysname, system.release, system.version), system.machine};
#endif
}

}  // namespace

RunFolder::RunFolder(fs::path path) : path_(std::move(path)) {
  std::error_code error;
  if (fs::exists(path_, error) && !fs::is_directory(path_, error)) {
    throw FolderError(fmt::format("--out: \"{}\" is a file; give a new or empty folder", path_.string()));
  }
  fs::create_directories(path_, error);
  if (error) {
    throw FolderError(fmt::format("--out: cannot create \"{}\": {}", path_.string(),
                                  rig::refusal(error.value(), path_.string(), rig::writing)));
  }
  if (!fs::is_empty(path_, error) || error) {
    throw FolderError(fmt::format("--out: \"{}\" is not empty, and nothing is overwritten; give a new or empty folder",
                                  path_.string()));
  }
}

void RunFolder::write(std::string_view name, std::string_view text) const {
  files::write_result(of(name), "file of the run folder", text);
}

void RunFolder::write(std::string_view name, const nlohmann::ordered_json& json) const {
  write(name, std::string_view(json.dump(2) + '\n'));
}

void RunFolder::seal() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path_)) {
    if (entry.is_regular_file() && entry.path().filename() != file::checksums) {
      names.push_back(entry.path().filename().string());
    }
  }
  std::sort(names.begin(), names.end());
  std::string sums;
  for (const std::string& name : names) sums += fmt::format("{}  {}\n", sha256_of_file(path_ / name), name);
  write(file::checksums, std::string_view(sums));
}

void check_seal(const fs::path& folder) {
  constexpr std::size_t digits = 64;
  const fs::path sums = folder / file::checksums;
  std::error_code error;
  if (!fs::exists(fs::symlink_status(sums, error))) return;
  std::ifstream lines(sums);
  std::size_t files = 0;
  for (std::string line; std::getline(lines, line); ++files) {
    const std::string name = line.size() > digits + 2 ? line.substr(digits + 2) : std::string();
    if (name.empty() || fs::path(name).has_parent_path()) {
      throw FolderError(
          fmt::format("\"{}\": line {} is damaged; restore this file from a copy", sums.string(), files + 1));
    }
    if (fs::exists(folder / name, error) && sha256_of_file(folder / name) != line.substr(0, digits)) {
      throw FolderError(
          fmt::format("\"{}\" is not as it was recorded (SHA256SUMS); restore it from a copy, or remove "
                      "SHA256SUMS to use the folder as it is",
                      (folder / name).string()));
    }
  }
  if (files == 0)
    throw FolderError(fmt::format("\"{}\" is empty or cannot be read; restore it from a copy", sums.string()));
}

fs::path default_runs_dir() {
  const char* given = std::getenv("ABS_HIL_RUNS_DIR");
  return given != nullptr ? fs::path(given) : fs::path("runs");
}

std::string sha256_of_file(const std::filesystem::path& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  Sha256 sum;
  std::vector<char> block(262'144);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    sum.add({block.data(), static_cast<std::size_t>(file.gcount())});
  }
  if (!file.eof()) {
    throw FolderError(fmt::format("cannot read \"{}\": {}", path.string(),
                                  rig::refusal(errno != 0 ? errno : EIO, path.string(), rig::reading)));
  }
  return sum.hex();
}

std::string sha256_of(std::string_view text) {
  Sha256 sum;
  sum.add(text);
  return sum.hex();
}

nlohmann::ordered_json environment_json(const RunEnvironment& run) {
  const version::BuildFacts build = version::build_facts();
  const System system = system_facts();
  std::error_code ignored;
  return {
      {"date_utc", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)))},
      {"command_line", run.command_line},
      {"working_directory", std::filesystem::current_path(ignored).string()},
      {"version", build.version},
      {"git_revision", build.git_revision},
      {"build_type", build.build_type},
      {"compiler", build.compiler},
      {"host", system.host},
      {"kernel", system.kernel},
      {"machine", system.machine},
      {"processor", processor_model()},
      {"processors", std::thread::hardware_concurrency()},
      {"backend", run.backend},
      {"board", {{"name", run.board}, {"emulated", run.emulated}, {"notes", run.board_notes}}},
      {"real_time",
       {{"virtual_time", run.virtual_time}, {"obtained", run.realtime}, {"shortcomings", run.realtime_shortcomings}}}};
}

}  // namespace abs_hil::run_folder
