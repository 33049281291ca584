#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "abs_hil/rig/time_units.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/csv_parts.hpp"
#include "telemetry/event_text.hpp"
#include "telemetry/message_codec.hpp"
#include "telemetry/recording.hpp"

namespace abs_hil::telemetry {
namespace {

namespace fs = std::filesystem;

/// RUN.csv -> RUN.PART.csv.
fs::path beside(const fs::path& csv, const std::string& part) {
  std::string clean = part;
  std::replace(clean.begin(), clean.end(), '/', '_');
  fs::path path = csv;
  path.replace_filename(csv.stem().string() + '.' + clean + ".csv");
  return path;
}

/// The files of one conversion. Each is opened for its first row; all appear at the end.
class CsvFiles {
 public:
  explicit CsvFiles(fs::path main) : main_(std::move(main)) {}

  /// The first channel of telemetry goes into the main file.
  void note_telemetry(const std::string& channel) {
    if (channel_.empty()) channel_ = channel;
  }
  void write(const LogEvent& event, const EventText& text) {
    const bool is_main = text.type == type_name<telemetry_t> && channel_ == event.channel;
    const std::string key = is_main ? std::string() : text.type == raw_type ? text.type : event.channel + text.type;
    auto file = files_.find(key);
    if (file == files_.end()) {
      file = open(key, is_main ? main_ : unused(text.type == raw_type ? text.type : event.channel, text.type),
                  text.header);
    }
    put(file->second, text.row);
  }

  void finish() {
    if (!files_.contains({})) open({}, main_, telemetry_header());  // a recording without telemetry
    std::vector<fs::path> done;
    try {
      // The main file is the first in the map and appears last: with it there are all others.
      for (auto file = files_.rbegin(); file != files_.rend(); ++file) {
        file->second.file.commit();
        done.push_back(file->second.path);
      }
    } catch (const files::FileError&) {
      std::error_code ignored;
      for (const fs::path& path : done) fs::remove(path, ignored);
      throw;
    }
  }

 private:
  struct File {
    explicit File(fs::path place) : path(std::move(place)), file(path, "CSV file") {}
    fs::path path;
    files::ResultFile file;
  };
  /// File names of two channels may collide, and a channel may carry several types. So names get a number if needed.
  fs::path unused(const std::string& part, const std::string& type) {
    fs::path path = beside(main_, part);
    const std::string typed = part + '.' + type;
    if (paths_.contains(path)) path = beside(main_, typed);
    for (int n = 2; paths_.contains(path); ++n) path = beside(main_, (typed + '.').append(std::to_string(n)));
    paths_.insert(path);
    return path;
  }
  std::map<std::string, File>::iterator open(const std::string& key, const fs::path& path, const std::string& header) {
    const auto file = files_.try_emplace(key, path).first;
    put(file->second, header);
    return file;
  }
  static void put(File& file, const std::string& line) {
    file.file.append(line);
    file.file.append("\n");
  }
  fs::path main_;
  std::string channel_;  ///< of the telemetry in the main file
  std::map<std::string, File> files_;
  std::set<fs::path> paths_;  ///< beside the main file
};

template <class Message>
std::optional<Message> decoded(const LogEvent& event) {
  Message message{};
  if (fingerprint_of(event.data) != static_cast<std::int64_t>(Message::getHash())) return std::nullopt;
  if (!decode_checked(event.data, message).empty()) return std::nullopt;
  return message;
}

/// Puts the events of a log into CSV files. A row of telemetry waits for the next one of its run, because a message
/// that belongs to it may follow it.
class LogToCsv {
 public:
  explicit LogToCsv(fs::path csv) : files_(std::move(csv)) {}

  void take(LogEvent event) {
    Run& run = runs_[prefix_of(event.channel)];
    if (const auto message = decoded<telemetry_t>(event)) {
      finish(run);
      files_.note_telemetry(event.channel);
      run.cells.sample_time_s = message->time_s;
      run.message = *message;
      run.waiting = std::move(event);
      return;
    }
    if (const auto message = decoded<sample_t>(event)) {
      // It holds from the next telemetry on.
      finish(run);
      run.cells.sample_valid = message->sample_valid != 0;
      run.cells.wheels_apart = message->wheels_apart != 0;
    } else if (const auto time = decoded<measurement_t>(event)) {
      if (run.waiting && time->cycle == run.message.cycle) {
        const std::int64_t start_ns = run.message.stamp_ns - std::llround(run.message.time_s * 1e9);
        run.cells.sample_time_s = static_cast<double>(time->measured_ns - start_ns) * rig::s_per_ns;
      }
    }
    write(event, text_of(event));
  }
  ConversionCounts finish(const std::string& cut) {
    for (auto& [prefix, run] : runs_) finish(run);
    files_.finish();
    counts_.cut = cut;
    return counts_;
  }

 private:
  struct Run {
    std::optional<LogEvent> waiting{};  ///< telemetry
    telemetry_t message{};              ///< the same
    CellsFromElsewhere cells{};
  };
  /// What the channels of a run have in common: telemetry.channel_prefix.
  static std::string prefix_of(const std::string& channel) {
    for (const std::string_view name : {"TELEMETRY", "SAMPLE", "MEASUREMENT"}) {
      if (channel.ends_with(name)) return channel.substr(0, channel.size() - name.size());
    }
    return channel;
  }
  void finish(Run& run) {
    if (!run.waiting) return;
    write(*run.waiting, text_of(*run.waiting, run.cells));
    run.waiting.reset();
  }
  void write(const LogEvent& event, const EventText& text) {
    files_.write(event, text);
    ++counts_.events;
    if (text.type == raw_type) ++counts_.raw;
  }

  CsvFiles files_;
  std::map<std::string, Run> runs_;
  ConversionCounts counts_;
};

}  // namespace

ConversionCounts log_to_csv(const fs::path& log, const fs::path& csv) {
  EventLogReader reader(log);
  for (const fs::path& part : csv_parts(csv)) {
    throw RecordingError("'" + part.string() + "' already exists and would be read as a part of '" + csv.string() +
                         "'; remove it, or choose another name");
  }
  LogToCsv conversion(csv);
  for (;;) {
    auto event = reader.next();
    if (!event) return conversion.finish(reader.cut());
    conversion.take(std::move(*event));
  }
}

}  // namespace abs_hil::telemetry
