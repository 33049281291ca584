// The folder of a study and the facts in it. Its files are members of gzip files, by zlib.
#include "study/study_folder.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "files/result_file.hpp"
#include "rig/formatted_text.hpp"
#include "rig/parse_json.hpp"
#include "run_folder/run_folder.hpp"
#include "version/build_facts.hpp"

namespace abs_hil::study {

namespace {

constexpr int gzip_window = MAX_WBITS + 16;  // zlib's way to ask for gzip's header
constexpr int memory_level = 8;              // zlib's default
constexpr int system_unknown = 255;

Bytef* bytes_of(const char* text) { return reinterpret_cast<Bytef*>(const_cast<char*>(text)); }

struct Inflated {
  GzipMember member{};
  bool whole{false};  ///< the bytes are one member
};

/// @param flush  of zlib: how far it reads
Inflated inflated(std::string_view bytes, int flush) {
  z_stream stream{};
  if (inflateInit2(&stream, gzip_window) != Z_OK) throw std::runtime_error("zlib cannot start to read");
  std::vector<char> note(bytes.size() + 1);
  gz_header header{};
  header.name = bytes_of(note.data());
  header.name_max = static_cast<uInt>(bytes.size());
  inflateGetHeader(&stream, &header);
  Inflated result;
  std::array<char, 65'536> block{};
  stream.next_in = bytes_of(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  int status = Z_OK;
  do {
    stream.next_out = bytes_of(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = inflate(&stream, flush);
    result.member.content.append(block.data(), block.size() - stream.avail_out);
  } while (status == Z_OK && flush == Z_NO_FLUSH);
  result.whole = status == Z_STREAM_END && stream.avail_in == 0;
  if (header.done == 1) result.member.note = note.data();
  inflateEnd(&stream);
  return result;
}

}  // namespace

namespace fs = std::filesystem;

namespace {

constexpr std::string_view part_ending = ".csv.gz";

std::string content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(fmt::format("cannot read \"{}\"", path.string()));
  return text.str();
}

/// The facts in the order of study.json. visit(key, member)
template <class Facts, class Visit>
void for_each_fact(Facts& facts, const Visit& visit) {
  visit("study", facts.name);
  visit("identity", facts.identity);
  visit("program", facts.program);
  visit("runs", facts.runs);
  visit("chunk", facts.chunk);
  visit("columns", facts.columns);
  visit("description", facts.description);
  visit("design", facts.design);
  visit("ranges", facts.ranges);
  visit("levels", facts.levels);
  visit("metrics", facts.metrics);
  visit("text", facts.text);
}

nlohmann::ordered_json to_json(const StudyFacts& facts) {
  nlohmann::ordered_json json;
  for_each_fact(facts, [&json](const char* key, const auto& value) { json[key] = value; });
  json["configurations"] = nlohmann::ordered_json::parse(facts.configurations);
  return json;
}

/// The whole configuration of every case and controller: files that the study names count with their content.
nlohmann::ordered_json configurations_of(const Study& study) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < study.cases().size(); ++i) {
    const StudyCase& one = study.cases()[i];
    nlohmann::ordered_json controllers = nlohmann::ordered_json::object();
    for (const Contender& contender : study.contenders(i)) {
      config::Settings settings = contender.settings;
      nlohmann::ordered_json config = config::KeyTable(settings).to_json();
      // What a simulated run in this process does not depend on.
      for (const char* table : {"driver", "guardian", "commands", "realtime", "telemetry", "unsafe"}) {
        config.erase(table);
      }
      controllers[contender.name] = std::move(config);
    }
    all.push_back({{"plant", one.plant}, {"experiment", one.experiment}, {"controllers", std::move(controllers)}});
  }
  return all;
}

StudyFacts read_facts(const fs::path& folder) {
  const fs::path path = folder / file::index;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    throw config::ConfigError(
        fmt::format("{}: holds no study ({} is missing); give the folder of a study", folder.string(), file::index));
  }
  try {
    const auto json = rig::parse_json<nlohmann::ordered_json>(content_of(path));
    StudyFacts facts{.configurations = json.at("configurations").dump()};
    for_each_fact(facts, [&json](const char* key, auto& value) { json.at(key).get_to(value); });
    if (facts.runs == 0 || facts.chunk == 0) throw std::runtime_error("no runs");
    return facts;
  } catch (const std::exception& problem) {
    throw config::ConfigError(
        fmt::format("{}: not the index of a study: {}; begin in another folder", path.string(), problem.what()));
  }
}

}  // namespace

StudyFacts facts_of(const Study& study, const std::string& name) {
  const StudyScript& script = study.script();
  StudyFacts facts{.program = version::version_line("abs_hil"),
                   .name = name,
                   .text = script.text,
                   .description = script.description,
                   .design = std::string(config::word_at<DesignKind>(static_cast<std::size_t>(script.design.kind))),
                   .runs = study.runs(),
                   .chunk = script.chunk,
                   .columns = result_columns(script),
                   .configurations = configurations_of(study).dump()};
  for (const Factor& factor : script.factors) {
    (factor.has_range() ? facts.ranges : facts.levels).push_back(factor.key);
  }
  facts.metrics.assign(std::ranges::find(facts.columns, "reason") + 1, facts.columns.end());
  facts.identity = run_folder::sha256_of(fmt::format("{}\n{}\n{}\n", facts.program, facts.text, facts.configurations));
  return facts;
}

StudyFolder::StudyFolder(fs::path path) : path_(std::move(path)), facts_(read_facts(path_)) { check_results(); }

StudyFolder::StudyFolder(fs::path path, StudyFacts facts) : path_(std::move(path)), facts_(std::move(facts)) {
  std::error_code error;
  fs::create_directories(path_, error);
  if (error) {
    throw config::ConfigError(fmt::format("{}: cannot create this folder: {}", path_.string(),
                                          rig::refusal(error.value(), path_.string(), rig::writing)));
  }
  if (fs::is_regular_file(path_ / file::index, error)) {
    const StudyFacts there = read_facts(path_);
    check_results();
    if (there.identity != facts_.identity) {
      const char* what = there.program != facts_.program ? "another program"
                         : there.text != facts_.text     ? "another study"
                                                         : "other plants, experiments or controllers of the same names";
      throw config::ConfigError(fmt::format("{}: holds results of {} ({}, {}); this is {}, {}: give another folder",
                                            path_.string(), what, there.name, there.program, facts_.name,
                                            facts_.program));
    }
  } else if (!fs::is_empty(path_, error) && !fs::is_directory(path_ / file::parts, error)) {
    throw config::ConfigError(
        fmt::format("{}: holds other files; give a new or empty folder, or that of this study", path_.string()));
  }
  fs::create_directories(path_ / file::parts, error);
  const fs::path parts = path_ / file::parts;
  if (!fs::exists(path_ / file::text, error)) files::write_result(path_ / file::text, "study", facts_.text, parts);
  if (!fs::exists(path_ / file::index, error))
    files::write_result(path_ / file::index, "study", to_json(facts_).dump(1) + '\n', parts);
}

/// The results of a complete study are as they were computed.
void StudyFolder::check_results() const try {
  if (complete()) run_folder::check_seal(path_);
} catch (const run_folder::FolderError& error) {
  throw config::ConfigError(error.what());
}

bool StudyFolder::complete() const {
  std::error_code error;
  return fs::is_regular_file(path_ / file::results, error);
}

fs::path StudyFolder::part(std::uint64_t number) const {
  return path_ / file::parts / fmt::format("{:08}{}", number, part_ending);
}

std::string StudyFolder::note_of(std::uint64_t number) const {
  return fmt::format("abs_hil study {} chunk {}", facts_.identity, number);
}

std::vector<bool> StudyFolder::finished() const {
  std::vector<bool> finished(facts_.chunks());
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(path_ / file::parts, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with(part_ending)) continue;
    const auto number = rig::parse_number<std::uint64_t>(name.substr(0, name.size() - part_ending.size()));
    if (number && *number < finished.size()) finished[*number] = true;
  }
  return finished;
}

bool StudyFolder::is_whole(std::uint64_t number) const try {
  static_cast<void>(checked_chunk(number, part(number)));
  return true;
} catch (const std::runtime_error&) {
  return false;
}

void StudyFolder::write_chunk(std::uint64_t number, std::string_view rows) const try {
  files::write_result(part(number), "chunk of a study", gzip_member(rows, note_of(number)));
} catch (const std::runtime_error&) {
  // Another process may have merged the chunks meanwhile; then this one, written again, is in the results already.
  if (!complete()) throw;
}

std::string StudyFolder::checked_chunk(std::uint64_t number, const fs::path& file) const {
  std::string bytes = content_of(file);
  const auto refuse = [&file](const std::string& why) {
    throw std::runtime_error(
        fmt::format("{}: {}; run the study again, which computes this chunk anew", file.string(), why));
  };
  GzipMember member;
  try {
    member = read_gzip_member(bytes);
  } catch (const std::runtime_error& error) {
    refuse(error.what());
  }
  if (member.note != note_of(number)) refuse("belongs to another study, another program or another chunk");
  const std::uint64_t first = number * facts_.chunk;
  std::uint64_t rows = 0;
  for (std::size_t at = 0; at < member.content.size(); ++rows) {
    if (!std::string_view(member.content).substr(at).starts_with(fmt::format("{},", first + rows))) {
      refuse(fmt::format("row {} is not that of run {}", rows + 1, first + rows));
    }
    at = std::min(member.content.find('\n', at), member.content.size() - 1) + 1;
  }
  if (rows != facts_.runs_in(number)) refuse(fmt::format("{} rows in place of {}", rows, facts_.runs_in(number)));
  return bytes;
}

void StudyFolder::merge(const std::vector<StudyFolder>& others) const {
  std::error_code error;
  if (!complete()) {
    std::vector<const StudyFolder*> folders{this};
    for (const StudyFolder& other : others) folders.push_back(&other);
    std::vector<std::vector<bool>> finished;
    for (const StudyFolder* folder : folders) {
      if (folder->facts_.identity != facts_.identity) {
        throw config::ConfigError(fmt::format("{}: holds another study than {}, or another program's results",
                                              folder->path_.string(), path_.string()));
      }
      finished.push_back(folder->finished());
    }
    std::vector<std::uint64_t> missing;
    std::vector<std::size_t> source(facts_.chunks());
    for (std::uint64_t number = 0; number < facts_.chunks(); ++number) {
      while (source[number] < folders.size() && !finished[source[number]][number]) ++source[number];
      if (source[number] == folders.size()) missing.push_back(number);
    }
    if (!missing.empty()) {
      throw std::runtime_error(
          fmt::format("{}: {} of {} chunks are missing: {}; run the study again with --out {}, it "
                      "computes these alone",
                      path_.string(), missing.size(), facts_.chunks(), list_of(missing), path_.string()));
    }
    fs::create_directories(path_ / file::parts);
    files::ResultFile results(path_ / file::results, "results",
                              path_ / file::parts);  // removed below, with what a killed process left
    std::string header = fmt::format("{}\n", fmt::join(facts_.columns, ","));
    // A file of its own then says what it is. ASCII, since readers take a note for Latin-1.
    results.append(gzip_member(header, to_json(facts_).dump(-1, ' ', true)));
    for (std::uint64_t number = 0; number < facts_.chunks(); ++number) {
      results.append(checked_chunk(number, folders[source[number]]->part(number)));
    }
    results.flush();
    // Before the results themselves: complete results always have checksums.
    std::string sums;
    for (const std::string_view name : {file::index, file::text, file::results}) {
      sums += fmt::format("{}  {}\n", run_folder::sha256_of_file(name == file::results ? results.part() : path_ / name),
                          name);
    }
    files::write_result(path_ / run_folder::file::checksums, "checksums", sums, path_ / file::parts);
    results.commit();
  }
  fs::remove_all(path_ / file::parts, error);
}

std::string list_of(const std::vector<std::uint64_t>& numbers) {
  constexpr std::size_t most_shown = 6;
  std::vector<std::string> shown;
  std::size_t at = 0;
  for (; at < numbers.size() && shown.size() < most_shown;) {
    std::size_t last = at;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    shown.push_back(last == at ? fmt::format("{}", numbers[at]) : fmt::format("{} to {}", numbers[at], numbers[last]));
    at = last + 1;
  }
  return fmt::format("{}{}", fmt::join(shown, ", "),
                     at < numbers.size() ? fmt::format(" and {} more", numbers.size() - at) : std::string());
}

std::string gzip_member(std::string_view content, const std::string& note) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, gzip_window, memory_level, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::runtime_error("zlib cannot start to compress");
  }
  std::string text = note;  // zlib takes a pointer that may write
  gz_header header{};
  header.os = system_unknown;
  header.name = bytes_of(text.data());
  deflateSetHeader(&stream, &header);
  std::string packed(deflateBound(&stream, content.size()) + note.size(), '\0');
  stream.next_in = bytes_of(content.data());
  stream.avail_in = static_cast<uInt>(content.size());
  stream.next_out = bytes_of(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int status = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (status != Z_STREAM_END) throw std::runtime_error("zlib cannot compress the results");
  return packed;
}

std::string gzip_note(std::string_view bytes) {
  const Inflated header = inflated(bytes, Z_BLOCK);  // ends behind the header
  if (header.member.note.empty()) throw std::runtime_error("no gzip file with a note");
  return header.member.note;
}

GzipMember read_gzip_member(std::string_view bytes) {
  Inflated all = inflated(bytes, Z_NO_FLUSH);
  if (!all.whole) throw std::runtime_error("damaged or cut off");
  return std::move(all.member);
}

}  // namespace abs_hil::study
