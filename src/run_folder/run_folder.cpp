// Folders of runs and of series of runs: their names, their checksums, and on what a run depended.
#include "run_folder/run_folder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "files/result_file.hpp"
#include "rig/formatted_text.hpp"
#include "rig/parse_json.hpp"
#include "run_folder/sha256.hpp"
#include "version/build_facts.hpp"
#ifndef _WIN32
#include <sys/utsname.h>
#include <unistd.h>
#endif

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

/// Letters from `first` on in ASCII: Latin ones without their marks, Greek by ELOT 743, Cyrillic as passports have it.
struct Script {
  char32_t first;
  std::string_view letters;
};
constexpr Script scripts[] = {
    {0xB5, "m"},
    {0xC0,
     "A A A A A A AE C E E E E I I I I D N O O O O O - O U U U U Y Th ss a a a a a a ae c e e e e i i i i d n o o o o "
     "o - o u u u u y th y A a A a A a C c C c C c C c D d D d E e E e E e E e E e G g G g G g G g H h H h I i I i I i "
     "I i I i IJ ij J j K k k L l L l L l L l L l N n N n N n n N n O o O o O o OE oe R r R r R r S s S s S s S s T t "
     "T t T t U u U u U u U u U u U u W w Y y Y Z z Z z Z z s"},
    {0x386,
     "A - E I I - O - Y O i A V G D E Z I Th I K L M N X O P R - S T Y F Ch Ps O I Y a e i i y a v g d e z i th i k l "
     "m n x o p r s s t y f ch ps o i y o y o"},
    {0x400,
     "E Yo Dj G Ye Dz I Yi J Lj Nj C K I U Dz A B V G D E Zh Z I Y K L M N O P R S T U F Kh Ts Ch Sh Shch  Y  E Yu "
     "Ya a b v g d e zh z i y k l m n o p r s t u f kh ts ch sh shch  y  e yu ya e yo dj g ye dz i yi j lj nj c k i "
     "u dz"}};

/// A character, of that code and those bytes, as a part of a name; "-" for what is no letter.
std::string in_ascii(char32_t code, std::string_view bytes) {
  constexpr std::string_view kept = "_=.";
  if (code < 0x80)
    return std::isalnum(static_cast<int>(code)) != 0 || kept.find(bytes) != kept.npos ? std::string(bytes) : "-";
  for (const Script& script : scripts) {
    const auto letters = rig::split(script.letters, ' ');
    if (code >= script.first && code - script.first < letters.size()) return std::string(letters[code - script.first]);
  }
  if (code >= 0x300 && code < 0x370) return {};  // a mark of the letter before
  // Letters of other scripts stay; between them are signs, and behind them what has no form of its own.
  return (code >= 0x531 && code < 0x2000) || (code >= 0x3041 && code < 0xD800) ? std::string(bytes) : "-";
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

std::string folder_name(std::string_view text, const fs::path& parent, std::size_t spare_bytes) {
  std::string name;
  for (std::size_t size = 0; !text.empty(); text.remove_prefix(size)) {
    const auto first = static_cast<unsigned char>(text.front());
    size = std::min<std::size_t>(first < 0xC0 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4, text.size());
    char32_t code = size == 1 ? first : first & (0x7FU >> size);
    for (const char c : text.substr(1, size - 1)) code = code << 6U | (static_cast<unsigned char>(c) & 0x3FU);
    const std::string piece = in_ascii(code, text.substr(0, size));
    if (piece != "-") {
      name += piece;
    } else if (!name.empty() && name.back() != '-') {
      name += '-';
    }
  }
  std::size_t most = 255;
#ifndef _WIN32
  if (const long allowed = ::pathconf(parent.empty() ? "." : parent.c_str(), _PC_NAME_MAX); allowed > 0)
    most = static_cast<std::size_t>(allowed);
#endif
  for (most -= spare_bytes; most < name.size() && (name[most] & 0xC0) == 0x80;) --most;  // not within a character
  name.resize(std::min(most, name.size()));
  name.erase(name.find_last_not_of("-.") + 1);
  return name.empty() ? "unnamed" : name;
}

fs::path unused_folder(const fs::path& parent, const std::tm& local_time, std::string_view experiment) {
  constexpr std::size_t around = 32;  // date and time, and a number at the end
  const fs::path path(experiment);
  const std::string name = path.extension() == ".toml" ? path.stem().string() : path.string();
  const std::string base = fmt::format("{:%Y%m%d-%H%M%S}-{}", local_time, folder_name(name, parent, around));
  std::error_code error;
  fs::create_directories(parent, error);
  fs::path folder = parent / base;
  // Another program may make the same one in this second: who makes it has it.
  for (int i = 2; !fs::create_directory(folder, error) && !error; ++i) folder = parent / fmt::format("{}-{}", base, i);
  return folder;
}

}  // namespace abs_hil::run_folder
