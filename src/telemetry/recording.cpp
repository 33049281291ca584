#include "telemetry/recording.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/csv_text.hpp"
#include "telemetry/file_error.hpp"
#include "telemetry/hexadecimal.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::telemetry {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using Fields = std::vector<std::string>;
using Columns = std::map<std::string, std::size_t, std::less<>>;  ///< place of each name

constexpr std::string_view event_columns = "log_event,log_time_us,channel,type";
constexpr std::string_view raw_type = "raw";

Fields split_header(std::string_view header) {
  Fields names;
  while (!header.empty()) {
    const std::size_t comma = std::min(header.find(','), header.size());
    names.emplace_back(header.substr(0, comma));
    header.remove_prefix(std::min(comma + 1, header.size()));
  }
  return names;
}

/// Columns of --csv. In a file of telemetry they come first, in the order of --csv. Other types do not have them.
template <class Message>
const Fields& first_columns() {
  static const Fields columns = [] {
    Fields names;
    if constexpr (std::same_as<Message, telemetry_t>) names.assign(rig::csv_columns.begin(), rig::csv_columns.end());
    return names;
  }();
  return columns;
}

/// Columns of --csv that telemetry does not hold: the values come from messages of other channels. They are in the CSV
/// for its readers only; csv_to_log takes the messages from their own files.
struct CellsFromElsewhere {
  bool sample_valid{true};
  bool wheels_apart{false};
  double sample_time_s{0.0};
};

template <class Message>
bool goes_first(std::string_view name) {
  return std::ranges::find(first_columns<Message>(), name) != first_columns<Message>().end();
}

template <class Message>
std::string header_of() {
  std::string header;
  const auto put = [&header](std::string_view name) { header.append(header.empty() ? "" : ",").append(name); };
  for (const std::string& name : first_columns<Message>()) put(name);
  Message message{};
  visit_fields(message, [&put](std::string_view name, const auto&) {
    if (!goes_first<Message>(name)) put(name);
  });
  return header.append(",").append(event_columns);
}

void put_event_columns(CsvRow& row, const LogEvent& event, std::string_view type) {
  row("", event.number);
  row("", event.timestamp_us);
  row("", event.channel);
  row.text(type);
}

/// The texts of `elsewhere` by their columns' names.
std::map<std::string_view, std::string> texts_of(const CellsFromElsewhere& elsewhere) {
  rig::CycleRecord record;
  record.sample_valid = elsewhere.sample_valid;
  record.wheels_apart = elsewhere.wheels_apart;
  record.sample_time_s = elsewhere.sample_time_s;
  const double distance_m = 0.0;
  const std::int64_t sequence = 0;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, sequence};
  std::map<std::string_view, std::string> texts;
  rig::for_each_quantity([&](const auto& quantity) {
    if (quantity.in_lcm()) return;
    CsvRow one;
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(quantity.at(parts))>>) one({}, quantity.at(parts));
    texts[quantity.name] = one.row();
  });
  return texts;
}

template <class Message>
std::string row_of(const Message& message, const LogEvent& event, const CellsFromElsewhere& elsewhere) {
  CsvRow row;
  if constexpr (std::same_as<Message, telemetry_t>) {
    std::map<std::string_view, std::string> texts = texts_of(elsewhere);
    visit_fields(message, [&texts](std::string_view name, const auto& value) {
      CsvRow one;
      one(name, value);
      texts[name] = one.row();
    });
    texts["phase"] = rig::name_of(static_cast<rig::Phase>(message.phase));
    for (const std::string& column : first_columns<Message>()) row.text(texts[column]);
  }
  visit_fields(message, [&row](std::string_view name, const auto& value) {
    if (!goes_first<Message>(name)) row(name, value);
  });
  put_event_columns(row, event, type_name<Message>);
  return row.row();
}

/// Sets a message's fields from the texts of a row.
class FieldTexts {
 public:
  FieldTexts(const Columns& columns, const Fields& fields) : columns_(columns), fields_(fields) {}

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void operator()(std::string_view name, Number& value) {
    const std::string* text = find(name);
    if (text == nullptr) return;
    if (name == "phase") {
      for (int phase = 0; phase <= telemetry_t::PHASE_FAULT; ++phase) {
        if (*text != rig::name_of(static_cast<rig::Phase>(phase))) continue;
        value = static_cast<Number>(phase);
        return;
      }
    }
    if (!parse_number(*text, value))
      problem_ = std::string(name) + ": '" + *text + "' is not a number of the field's type";
  }
  void operator()(std::string_view name, std::string& value) {
    if (const std::string* text = find(name)) value = *text;
  }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const std::string* find(std::string_view name) {
    const auto column = columns_.find(name);
    if (column != columns_.end()) return &fields_[column->second];
    problem_ = "the column " + std::string(name) + " is missing";
    return nullptr;
  }
  const Columns& columns_;
  const Fields& fields_;
  std::string problem_;
};

template <class Message>
Bytes encoded(const Message& message) {
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(message);
  return {bytes.begin(), bytes.end()};
}

Columns columns_of(const Fields& header) {
  Columns columns;
  for (std::size_t i = 0; i < header.size(); ++i) columns[header[i]] = i;
  return columns;
}

/// An event in CSV: the type and header of its file, and its row.
struct EventText {
  std::string type;
  std::string header;
  std::string row;
};

/// True if the row gives the event's bytes again.
template <class Message>
bool comes_back(const EventText& text, const LogEvent& event) {
  std::FILE* memory = ::fmemopen(const_cast<char*>(text.row.data()), text.row.size(), "r");
  if (memory == nullptr) return false;
  const detail::FilePointer owner(memory);
  static const Columns columns = columns_of(split_header(header_of<Message>()));
  Fields fields;
  if (!CsvRows(memory).next(fields) || fields.size() != columns.size()) return false;
  Message message{};
  FieldTexts texts(columns, fields);
  visit_fields(message, texts);
  return texts.problem().empty() && encoded(message) == event.data;
}

EventText text_of(const LogEvent& event, const CellsFromElsewhere& elsewhere = {}) {
  EventText text;
  const std::int64_t fingerprint = fingerprint_of(event.data);
  for_each_message_type([&]<class Message>() {
    if (!text.row.empty() || fingerprint != static_cast<std::int64_t>(Message::getHash())) return;
    Message message{};
    if (!decode_checked(event.data, message).empty()) return;
    EventText made{std::string(type_name<Message>), header_of<Message>(), row_of(message, event, elsewhere)};
    if (comes_back<Message>(made, event)) text = std::move(made);
  });
  if (!text.row.empty()) return text;
  CsvRow row;
  row.text(hexadecimal(event.data));
  put_event_columns(row, event, raw_type);
  return {std::string(raw_type), std::string("data_hex,").append(event_columns), row.row()};
}

/// RUN.csv -> RUN.PART.csv.
fs::path beside(const fs::path& csv, const std::string& part) {
  std::string clean = part;
  std::replace(clean.begin(), clean.end(), '/', '_');
  fs::path path = csv;
  path.replace_filename(csv.stem().string() + '.' + clean + ".csv");
  return path;
}

/// The files of one conversion. Each is opened for its first row.
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
    if (!files_.contains({})) open({}, main_, header_of<telemetry_t>());  // a recording without telemetry
    for (auto& [key, file] : files_) {
      errno = 0;
      if (std::fclose(file.stream.release()) != 0) throw FileError("CSV file", file.path, errno != 0 ? errno : EIO);
    }
  }

 private:
  struct File {
    fs::path path;
    detail::FilePointer stream;
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
    detail::FilePointer opened(std::fopen(path.c_str(), "wb"));
    if (!opened) throw FileError("CSV file", path, errno);
    const auto file = files_.emplace(key, File{path, std::move(opened)}).first;
    put(file->second, header);
    return file;
  }
  static void put(File& file, const std::string& line) {
    const bool whole = std::fwrite(line.data(), 1, line.size(), file.stream.get()) == line.size();
    if (!whole || std::fputc('\n', file.stream.get()) == EOF) throw FileError("CSV file", file.path, errno);
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
  ConversionCounts finish() {
    for (auto& [prefix, run] : runs_) finish(run);
    files_.finish();
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

/// RUN.csv and all RUN.*.csv beside it.
std::vector<fs::path> csv_parts(const fs::path& csv) {
  std::vector<fs::path> parts;
  const std::string prefix = csv.stem().string() + '.';
  std::error_code error;
  const fs::path folder = csv.has_parent_path() ? csv.parent_path() : fs::path(".");
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const fs::path name = entry.path().filename();
    const bool is_part = name.extension() == ".csv" && name.string().starts_with(prefix) && name != csv.filename();
    if (is_part) parts.push_back(entry.path());
  }
  std::sort(parts.begin(), parts.end());
  return parts;
}

[[noreturn]] void fail(const fs::path& path, std::uint64_t row, const std::string& what) {
  throw RecordingError("'" + path.string() + "': row " + std::to_string(row) + ": " + what);
}

/// Returns the message bytes of a row. Fails if the row does not give them.
Bytes data_of(const fs::path& path, std::uint64_t row, const Columns& columns, const Fields& fields) {
  const std::string& type = fields[columns.at("type")];
  if (type == raw_type && columns.contains("data_hex")) {
    if (auto bytes = bytes_of_hexadecimal(fields[columns.at("data_hex")])) return std::move(*bytes);
    fail(path, row, "data_hex is not a text of hexadecimal digits");
  }
  std::optional<Bytes> data;
  for_each_message_type([&]<class Message>() {
    if (type != type_name<Message>) return;
    Message message{};
    FieldTexts texts(columns, fields);
    visit_fields(message, texts);
    if (!texts.problem().empty()) fail(path, row, texts.problem());
    data = encoded(message);
  });
  if (!data) fail(path, row, "type '" + type + "' is unknown");
  return std::move(*data);
}

void read_csv(const fs::path& path, std::map<std::int64_t, LogEvent>& events) {
  const detail::FilePointer file(std::fopen(path.c_str(), "rb"));
  if (!file) throw RecordingError("'" + path.string() + "': " + std::strerror(errno));
  CsvRows rows(file.get());
  Fields header;
  const bool any = rows.next(header);
  const Columns columns = columns_of(header);
  const bool whole = columns.contains("log_event") && columns.contains("log_time_us") && columns.contains("channel") &&
                     columns.contains("type");
  if (!any || !whole) {
    throw RecordingError("'" + path.string() + "': no columns " + std::string(event_columns) +
                         "; a run's --csv holds neither encoder counts nor configuration; give its event log (--log), "
                         "or CSV that abs_hil convert made of one");
  }
  Fields fields;
  while (rows.next(fields)) {
    if (fields.size() != header.size()) {
      fail(path, rows.row(), std::to_string(fields.size()) + " fields instead of " + std::to_string(header.size()));
    }
    LogEvent event;
    if (!parse_number(fields[columns.at("log_event")], event.number) ||
        !parse_number(fields[columns.at("log_time_us")], event.timestamp_us)) {
      fail(path, rows.row(), "log_event or log_time_us is not a whole number");
    }
    event.channel = fields[columns.at("channel")];
    event.data = data_of(path, rows.row(), columns, fields);
    const std::int64_t number = event.number;
    if (!events.emplace(number, std::move(event)).second) {
      fail(path, rows.row(), "log_event " + std::to_string(number) + " occurs twice");
    }
  }
}

std::map<std::int64_t, LogEvent> read_all_csv(const fs::path& csv) {
  std::map<std::int64_t, LogEvent> events;
  read_csv(csv, events);
  for (const fs::path& part : csv_parts(csv)) read_csv(part, events);
  return events;
}

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
    if (!event) return conversion.finish();
    conversion.take(std::move(*event));
  }
}

ConversionCounts csv_to_log(const fs::path& csv, const fs::path& log) {
  const auto events = read_all_csv(csv);
  EventLogWriter writer(log);
  ConversionCounts counts;
  for (const auto& [number, event] : events) {
    writer.write(event);
    ++counts.events;
  }
  writer.finish();
  return counts;
}

void for_each_event(const fs::path& recording, const std::function<void(const LogEvent&)>& take) {
  if (recording.extension() == ".csv") {
    for (const auto& [number, event] : read_all_csv(recording)) take(event);
    return;
  }
  EventLogReader reader(recording);
  for (;;) {
    const auto event = reader.next();
    if (!event) return;
    take(*event);
  }
}

}  // namespace abs_hil::telemetry
