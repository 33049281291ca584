// Turns an event log into CSV files, one a channel.

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "abs_hil/rig/quantities.hpp"
#include "files/result_file.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/csv_text.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::telemetry {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view event_columns = "log_event,log_time_us,channel,type";
constexpr std::string_view raw_type = "raw";

/// An event in CSV: the type and header of its file, and its row.
struct EventText {
  std::string type;
  std::string header;
  std::string row;
};

/// The columns of a file, or the fields of its rows.
class Line {
 public:
  explicit Line(bool header) : header_(header) {}
  template <class Value>
  void operator()(std::string_view name, const Value& value) {
    header_ ? row_.text(name) : row_(name, value);
  }
  void operator()(std::string_view name, rig::Phase value) { (*this)(name, std::string(rig::name_of(value))); }
  void operator()(std::string_view name, const std::vector<double>& values) {
    std::string text;
    for (const double value : values) text.append(text.empty() ? "" : " ").append(CsvRow::text_of(value));
    (*this)(name, text);
  }
  [[nodiscard]] const std::string& text() const noexcept { return row_.row(); }

 private:
  bool header_;
  CsvRow row_;
};

/// What follows the columns of --csv: names of phase and signals as in --csv, then the quantities that it lacks.
void put_rest(const telemetry_t& message, const rig::CycleRecord& record, Line& line) {
  if (!message.phase_name.empty()) line(phase_name_column, message.phase_name);
  const std::vector<std::string> signals = signals_of(message);
  for (std::size_t n = 0; n < signals.size(); ++n) line(signals[n], record.control.signals.at(n));
  const rig::CycleParts<const rig::CycleRecord> parts{record, message.distance_m, message.sequence};
  rig::for_each_quantity([&](const auto& row) {
    using Value = rig::ValueOf<std::decay_t<decltype(row)>>;
    if (row.in_csv()) return;
    if constexpr (std::is_enum_v<Value>) {
      line(row.name, static_cast<std::int64_t>(row.at(parts)));
    } else {
      line(row.name, row.at(parts));
    }
  });
}

EventText text_of(const telemetry_t& message) {
  const rig::CycleRecord record = to_record(message);
  char fixed[csv_row_max_bytes];
  const std::size_t size = format_csv_row(record, message.distance_m, fixed) - 1;  // without its line end
  Line header(true), row(false);
  put_rest(message, record, header);
  put_rest(message, record, row);
  return {std::string(type_name<telemetry_t>), std::string(csv_header).append(",").append(header.text()),
          std::string(fixed, size).append(",").append(row.text())};
}

template <class Message>
EventText text_of(const Message& message) {
  Line header(true), row(false);
  visit_fields(message, header);
  visit_fields(message, row);
  return {std::string(type_name<Message>), header.text(), row.text()};
}

/// The files of one conversion. Each is opened for its first row; all appear at the end.
class LogToCsv {
 public:
  explicit LogToCsv(fs::path main) : main_(std::move(main)) {}

  void take(const LogEvent& event) {
    EventText text;
    const std::int64_t fingerprint = fingerprint_of(event.data);
    for_each_message_type([&]<class Message>() {
      if (fingerprint != static_cast<std::int64_t>(Message::getHash())) return;
      Message message{};
      if (!decode_checked(event.data, message).empty()) return;
      text = text_of(message);
      if constexpr (std::same_as<Message, telemetry_t>) note_telemetry(message, event.channel, text.header);
    });
    if (text.type.empty()) {
      text = {std::string(raw_type), "data_hex", hexadecimal(event.data)};
      ++counts_.raw;
    }
    ++counts_.events;
    CsvRow told;
    told("", event.number);
    told("", event.timestamp_us);
    told("", event.channel);
    told.text(text.type);
    write(event.channel, text, told.row());
  }

  ConversionCounts finish(const std::string& cut) {
    if (!files_.contains(main_key_)) open(main_key_, main_, std::string(csv_header));  // a log without telemetry
    std::vector<fs::path> done;
    try {
      // The main file appears last: with it there are all others.
      for (auto& [key, file] : files_) {
        if (key != main_key_) commit(file, done);
      }
      commit(files_.at(main_key_), done);
    } catch (const files::FileError&) {
      std::error_code ignored;
      for (const fs::path& path : done) fs::remove(path, ignored);
      throw;
    }
    counts_.cut = cut;
    return counts_;
  }

 private:
  struct File {
    explicit File(fs::path place) : path(std::move(place)), file(path, "CSV file") {}
    fs::path path;
    files::ResultFile file;
  };
  static void commit(File& file, std::vector<fs::path>& done) {
    file.file.commit();
    done.push_back(file.path);
  }
  static std::string key_of(const std::string& channel, const EventText& text) {
    return text.type == raw_type ? text.type : channel + '\n' + text.type + '\n' + text.header;
  }
  /// The first channel of telemetry goes into the main file.
  void note_telemetry(const telemetry_t& message, const std::string& channel, const std::string& header) {
    if (!main_key_.empty()) return;
    main_key_ = key_of(channel, {std::string(type_name<telemetry_t>), header, {}});
    counts_.lacks = fmt::format("{}", fmt::join(lacking_in(message), ", "));
  }
  void write(const std::string& channel, const EventText& text, const std::string& told) {
    const std::string key = key_of(channel, text);
    auto file = files_.find(key);
    if (file == files_.end()) {
      const fs::path path = key == main_key_ ? main_ : unused(text.type == raw_type ? text.type : channel, text.type);
      file = open(key, path, text.header);
    }
    file->second.file.append(text.row + ',' + told + '\n');
  }
  /// File names of two channels may collide, and a channel may carry several types. So names get a number if needed.
  fs::path unused(std::string part, const std::string& type) {
    std::replace(part.begin(), part.end(), '/', '_');
    const auto beside = [this](const std::string& name) {
      return fs::path(main_).replace_filename(main_.stem().string() + '.' + name + ".csv");
    };
    fs::path path = beside(part);
    const std::string typed = part + '.' + type;
    if (paths_.contains(path)) path = beside(typed);
    for (int n = 2; paths_.contains(path); ++n) path = beside((typed + '.').append(std::to_string(n)));
    paths_.insert(path);
    return path;
  }
  std::map<std::string, File>::iterator open(const std::string& key, const fs::path& path, const std::string& header) {
    const auto file = files_.try_emplace(key, path).first;
    file->second.file.append(header + ',' + std::string(event_columns) + '\n');
    return file;
  }

  fs::path main_;
  std::string main_key_;  ///< of the telemetry in the main file
  std::map<std::string, File> files_;
  std::set<fs::path> paths_;  ///< beside the main file
  ConversionCounts counts_;
};

}  // namespace

ConversionCounts log_to_csv(const fs::path& log, const fs::path& csv) {
  LogToCsv conversion(csv);
  return conversion.finish(for_each_event(log, [&conversion](const LogEvent& event) { conversion.take(event); }));
}

}  // namespace abs_hil::telemetry
