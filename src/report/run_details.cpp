#include "report/run_details.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <sstream>

#include "report/input_error.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

/// Side files are small. A larger file is not one, and must not fill the memory.
constexpr std::uintmax_t most_bytes = 64U << 20U;
/// Largest accepted bin of a histogram, 10 s; larger ones would waste memory.
constexpr std::uint64_t most_us = 10'000'000;
constexpr std::size_t event_fields = 5;

/// The summary has 23.0 where config.toml has 23: both become 23, so that they compare equal.
std::string number_text(double value) { return fmt::format("{}", value); }

void flatten(const nlohmann::ordered_json& json, const std::string& prefix, std::map<std::string, std::string>& flat) {
  for (const auto& [key, value] : json.items()) {
    const std::string name = prefix + clean_text(key, 60);
    if (value.is_object()) {
      flatten(value, name + '.', flat);
    } else if (value.is_number_float()) {
      flat[name] = number_text(value.get<double>());
    } else {
      flat[name] = clean_text(value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
}

void flatten(const toml::table& table, const std::string& prefix, std::map<std::string, std::string>& flat) {
  for (const auto& [key, value] : table) {
    const std::string name = prefix + clean_text(key.str(), 60);
    if (const toml::table* inner = value.as_table()) {
      flatten(*inner, name + '.', flat);
      continue;
    }
    std::ostringstream text;
    if (const auto* string = value.as_string()) {
      text << string->get();
    } else if (const auto* number = value.as_floating_point()) {
      text << number_text(number->get());
    } else {
      text << toml::node_view<const toml::node>(value);
    }
    flat[name] = clean_text(text.str());
  }
}

/// Fields of a CSV line. A field in double quotes may contain commas, and "" stands for ".
std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"') {
      fields.back() += line[++i];
    } else if (line[i] == '"') {
      quoted = !quoted;
    } else if (line[i] == ',' && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += line[i];
    }
  }
  return fields;
}

}  // namespace

std::string read_text(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (!error && size > most_bytes) {
    throw InputError(fmt::format("{}: {} bytes are too many for this kind of file", path.string(), size));
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) {
    throw InputError(fmt::format("cannot read \"{}\": {}", path.string(), std::strerror(errno != 0 ? errno : EIO)));
  }
  return text.str();
}

nlohmann::ordered_json read_json(const std::filesystem::path& path) {
  try {
    auto json = nlohmann::ordered_json::parse(read_text(path));
    if (!json.is_object()) throw InputError(path, 1, "the file must contain a JSON object");
    return json;
  } catch (const nlohmann::ordered_json::exception& error) {
    throw InputError(fmt::format("{}: not valid JSON: {}", path.string(), clean_text(error.what())));
  }
}

std::map<std::string, std::string> flattened(const nlohmann::ordered_json& json) {
  std::map<std::string, std::string> flat;
  flatten(json, "", flat);
  return flat;
}

std::map<std::string, std::string> read_toml(const std::filesystem::path& path) {
  try {
    std::map<std::string, std::string> flat;
    flatten(toml::parse(read_text(path)), "", flat);
    return flat;
  } catch (const toml::parse_error& error) {
    throw InputError(path, error.source().begin.line, clean_text(error.description()));
  }
}

std::vector<RunEvent> read_events(const std::filesystem::path& path) {
  std::istringstream lines(read_text(path));
  std::string line;
  std::getline(lines, line);
  if (!line.starts_with("time_s,event,phase,reason,value")) {
    throw InputError(path, 1, "the header must begin with \"time_s,event,phase,reason,value\"");
  }
  std::vector<RunEvent> events;
  for (std::size_t number = 2; std::getline(lines, line); ++number) {
    const bool cut_off = lines.eof();  // a line without line end is the trace of a crash
    const std::vector<std::string> fields = fields_of(line);
    RunEvent event;
    const bool complete = fields.size() >= event_fields;
    const char* const begin = fields[0].data();
    const auto parsed = std::from_chars(begin, begin + fields[0].size(), event.time_s);
    if (!complete || parsed.ec != std::errc{} || parsed.ptr != begin + fields[0].size()) {
      if (cut_off) break;
      throw InputError(path, number, fmt::format("not an event: \"{}\"", clean_text(line, 60)));
    }
    event.event = clean_text(fields[1], 40);
    event.phase = clean_text(fields[2], 40);
    event.reason = clean_text(fields[3]);
    event.value = clean_text(fields[4], 40);
    events.push_back(std::move(event));
  }
  return events;
}

TimingHistogram read_histogram(const std::filesystem::path& path) {
  std::istringstream lines(read_text(path));
  TimingHistogram histogram;
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    if (number == 1 && !line.starts_with("# abs_hil, us;")) {
      throw InputError(path, 1, "not a histogram of abs_hil: the file must begin with \"# abs_hil, us;\"");
    }
    constexpr std::string_view overflow_title = "# Histogram Overflows:";
    const bool overflow = line.starts_with(overflow_title);
    if (line.empty() || (line.front() == '#' && !overflow)) continue;
    std::istringstream fields(overflow ? line.substr(overflow_title.size()) : line);
    std::uint64_t bin_us = 0;
    if (!overflow) fields >> bin_us;
    std::array<std::uint64_t, TimingHistogram::parts.size()> counts{};
    for (std::uint64_t& count : counts) fields >> count;
    if (!fields || bin_us > most_us) {
      throw InputError(path, number, fmt::format("not a line of a histogram: \"{}\"", clean_text(line, 60)));
    }
    for (std::size_t part = 0; part < counts.size(); ++part) {
      if (overflow) {
        histogram.overflows[part] = counts[part];
        continue;
      }
      auto& bins = histogram.counts[part];
      if (bins.size() <= bin_us) bins.resize(bin_us + 1, 0);
      bins[bin_us] += counts[part];
    }
  }
  return histogram;
}

}  // namespace abs_hil::report
