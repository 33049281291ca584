// Reads LCM event logs, with checks of sync words, lengths and numbers, and tells their runs apart.
#include "telemetry/event_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>
#include <utility>

#include "abs_hil/experiment_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::uint32_t sync_word = 0xEDA1DA01;
constexpr std::uint32_t channel_max_bytes = 63;
constexpr std::uint32_t data_max_bytes = 1U << 28U;  // LCM's own limit

/// A network may bring a message this many cycles late. A run that begins again goes further back, or to cycle 0.
constexpr std::int64_t late_cycles = 200;
/// No more go on at once, so that the time grows with the file alone.
constexpr std::size_t recent_runs = 100;
/// Times beyond this one are damaged.
constexpr double latest_s = 2e9;

std::string_view prefix_of(std::string_view channel) {
  for (const std::string_view name :
       {"TELEMETRY", "EXPERIMENT", "STATUS", "EVENT", "COMMAND_STATE", "COMMAND", "ADJUSTMENT"}) {
    if (channel.ends_with(name)) return channel.substr(0, channel.size() - name.size());
  }
  return channel;
}

}  // namespace

EventLogReader::EventLogReader(std::filesystem::path path) : path_(std::move(path)), file_(path_, std::ios::binary) {
  std::error_code error;
  if (file_) size_ = std::filesystem::file_size(path_, error);
  if (!file_ || error) {
    throw RecordingError("'" + path_.string() +
                         "': " + (file_.is_open() ? "not a regular file" : std::strerror(errno)) +
                         "; give an LCM event log (.lcmlog), as --log writes it");
  }
  header_read_ = read_into(header_.data(), header_.size());
}

std::string EventLogReader::place(const std::string& what) const {
  return "'" + path_.string() + "': event " + std::to_string(events_) + " at byte " + std::to_string(at_) + ": " + what;
}

std::size_t EventLogReader::read_into(void* to, std::size_t size) {
  file_.read(static_cast<char*>(to), static_cast<std::streamsize>(size));
  return static_cast<std::size_t>(file_.gcount());
}

bool EventLogReader::header_begins() const {
  return header_read_ >= sizeof sync_word && boost::endian::load_big_u32(header_.data()) == sync_word;
}

/// Looks for the next event that begins behind the beginning of this one, which is not whole, and before `end`. If its
/// number is 0, another recording was appended to a cut one: the reader goes there.
EventLogReader::Behind EventLogReader::look_behind(std::uint64_t end) {
  const auto seek = [this](std::uint64_t to) {
    file_.clear();
    if (!file_.seekg(static_cast<std::streamoff>(to))) fail(std::strerror(errno));
  };
  seek(at_ + 1);
  std::uint32_t last = 0;
  for (char byte = 0; last != sync_word; last = last << 8U | static_cast<unsigned char>(byte)) {
    if (!file_.get(byte)) return Behind::nothing;
  }
  const auto found = static_cast<std::uint64_t>(file_.tellg()) - sizeof sync_word;
  if (found >= end) return Behind::nothing;
  std::array<std::uint8_t, sizeof(std::int64_t)> number{};
  read_into(number.data(), number.size());
  if (boost::endian::load_big_s64(number.data()) != 0) return Behind::events;
  note_cut("the recording is cut off; another one, which was appended to it, begins at byte " + std::to_string(found));
  seek(found);
  header_read_ = read_into(header_.data(), header_.size());
  at_ = found;
  ++part_;
  events_ = 0;
  return Behind::recording;
}

/// Reads the event whose header is there, and the header behind it. Returns nothing if the event is whole, else why it
/// is not; an empty text: the recording may be cut off there.
std::optional<std::string> EventLogReader::read_event(LogEvent& event) {
  if (!header_begins()) {
    if (at_ == 0) fail("not an LCM event log; give a .lcmlog, as --log and lcm-logger write it");
    return header_read_ < sizeof sync_word ? "" : "no event begins here";
  }
  if (header_read_ != header_.size()) return "";
  event.number = boost::endian::load_big_s64(&header_[4]);
  event.timestamp_us = boost::endian::load_big_s64(&header_[12]);
  const std::uint32_t channel_bytes = boost::endian::load_big_u32(&header_[20]);
  const std::uint32_t data_bytes = boost::endian::load_big_u32(&header_[24]);
  if (channel_bytes == 0 || channel_bytes > channel_max_bytes || data_bytes > data_max_bytes) {
    return "these lengths are not valid";
  }
  if (event.number == 0 && events_ > 0) {
    ++part_;
    events_ = 0;
  }
  if (event.number < events_) return "event number " + std::to_string(event.number);
  // Checked before memory is allocated, because a damaged length may have any value.
  const std::uint64_t end = at_ + event_header_bytes + channel_bytes + data_bytes;
  if (size_ < end) return "";
  event.part = part_;
  event.channel.resize(channel_bytes);
  event.data.resize(data_bytes);
  if (read_into(event.channel.data(), channel_bytes) != channel_bytes ||
      read_into(event.data.data(), data_bytes) != data_bytes) {
    fail("it changed while it was read");
  }
  header_read_ = read_into(header_.data(), header_.size());
  return std::nullopt;
}

std::optional<LogEvent> EventLogReader::next() {
  while (header_read_ > 0) {
    LogEvent event;
    if (std::optional<std::string> damage = read_event(event)) {
      const Behind behind = look_behind(size_);
      if (behind == Behind::recording) continue;
      if (damage->empty() && behind == Behind::events) {
        damage = "its length reaches beyond the end, but other events follow";
      }
      if (!damage->empty()) fail("the file is damaged: " + *damage);
      if (at_ == 0) fail("the file is cut off within its first message and holds nothing else");
      note_cut("the file is cut off, as that of a program that was killed; it is read up to here");
      header_read_ = 0;
      return std::nullopt;
    }
    // A cut message may have got its rest from an appended recording. Then no event begins behind it, or another one.
    const auto following = boost::endian::load_big_s64(&header_[4]);
    const std::uint64_t end = at_ + event_header_bytes + event.channel.size() + event.data.size();
    const bool goes_on =
        header_begins() && (header_read_ < header_.size() || following == 0 || following > event.number);
    if (header_read_ > 0 && !goes_on && look_behind(end) == Behind::recording) continue;
    at_ = end;
    events_ = event.number == std::numeric_limits<std::int64_t>::max() ? event.number : event.number + 1;
    return event;
  }
  return std::nullopt;
}

std::string for_each_event(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& take) {
  EventLogReader reader(log);
  while (const auto event = reader.next()) take(*event);
  return reader.cut();
}

std::size_t RunSeparator::run_of(const LogEvent& event) {
  const std::string_view prefix = prefix_of(event.channel);
  ++events_;
  // The run of this prefix, heard last, for which `is` is true.
  const auto find = [&](const auto& is) {
    Run* found = nullptr;
    for (Run& run : std::span(runs_).last(std::min(runs_.size(), recent_runs))) {
      if (run.prefix == prefix && is(run) && (found == nullptr || run.heard > found->heard)) found = &run;
    }
    return found;
  };
  const auto begin = [&] { return &runs_.emplace_back(Run{.prefix = std::string(prefix)}); };

  // What all our messages begin with, and telemetry_t goes on with.
  std::int64_t fingerprint = 0, stamp_ns = 0, sequence = 0, cycle = 0;
  double time_s = 0.0;
  FieldReader read(event.data);
  for (std::int64_t* field : {&fingerprint, &stamp_ns, &sequence, &cycle}) read({}, *field);
  read({}, time_s);
  Run* run = find([](const Run&) { return true; });
  if (read.sound() && fingerprint == static_cast<std::int64_t>(telemetry_t::getHash())) {
    const auto time_ns = std::abs(time_s) < latest_s ? std::llround(time_s * 1e9) : 0;
    const std::uint64_t start_ns = static_cast<std::uint64_t>(stamp_ns) - static_cast<std::uint64_t>(time_ns);
    const auto same = [&](const Run& r) { return r.heard_cycle && start_ns == r.start_ns; };
    const auto later = [&](const Run& r) { return r.heard_cycle && cycle > r.cycle; };
    const auto next = [&](const Run& r) {  // unsigned: a damaged number may be any
      return r.heard_cycle && static_cast<std::uint64_t>(sequence) == static_cast<std::uint64_t>(r.sequence) + 1;
    };
    // One damaged number begins no run.
    run = find([&](const Run& r) { return same(r) && later(r) && next(r); });
    if (run == nullptr) run = find([](const Run& r) { return !r.heard_cycle; });
    if (run == nullptr) run = find([&](const Run& r) { return same(r) && (later(r) || next(r)); });
    if (run == nullptr) run = find([&](const Run& r) { return later(r) && next(r); });
    if (run == nullptr) {
      run = find([&](const Run& r) { return same(r) && cycle > 0 && r.cycle - cycle < late_cycles; });
      if (run == nullptr) run = begin();
      if (run->heard_cycle) std::tie(cycle, sequence) = std::tie(run->cycle, run->sequence);
    }
    if (!std::exchange(run->heard_cycle, true))
      std::tie(run->start_ns, run->first_stamp_ns) = std::tie(start_ns, stamp_ns);
    std::tie(run->cycle, run->sequence) = std::tie(cycle, sequence);
  } else if (read.sound() && fingerprint == static_cast<std::int64_t>(experiment_t::getHash())) {
    const bool first = sequence == 0 && run != nullptr && (run->described || run->first_stamp_ns != stamp_ns);
    if (run == nullptr || first) run = begin();
    run->described = true;
  }
  if (run == nullptr) return runs_.empty() ? 0 : runs_.size() - 1;
  run->heard = events_;
  return static_cast<std::size_t>(run - runs_.data());
}

NamedRecording::NamedRecording(const std::string& name) : path(name) {
  const std::size_t mark = name.rfind('#');
  std::error_code error;
  if (mark == std::string::npos || std::filesystem::exists(name, error)) return;
  run = rig::parse_number<std::size_t>(std::string_view(name).substr(mark + 1)).value_or(0);
  if (run > 0) path = name.substr(0, mark);
}

std::size_t chosen_run(const NamedRecording& recording, std::size_t runs) {
  const std::string& path = recording.path;
  if (recording.run > std::max<std::size_t>(runs, 1)) {
    throw RecordingError(fmt::format("'{}' has no run {}, it holds {}; `abs_hil log info {}` says what it holds", path,
                                     recording.run, runs, path));
  }
  if (recording.run == 0 && runs > 1) {
    throw RecordingError(
        fmt::format("'{0}' holds {1} runs: give '{0}#1' for the first, '{0}#2' for the second{2}; `abs_hil log info "
                    "{0}` lists them",
                    path, runs, runs > 2 ? " and so on" : ""));
  }
  return std::max<std::size_t>(recording.run, 1) - 1;
}

void append_event(std::string& log, std::int64_t number, std::int64_t timestamp_us, std::string_view channel,
                  std::span<const std::uint8_t> data) {
  std::array<std::uint8_t, event_header_bytes> header{};
  boost::endian::store_big_u32(header.data(), sync_word);
  boost::endian::store_big_s64(&header[4], number);
  boost::endian::store_big_s64(&header[12], timestamp_us);
  boost::endian::store_big_u32(&header[20], static_cast<std::uint32_t>(channel.size()));
  boost::endian::store_big_u32(&header[24], static_cast<std::uint32_t>(data.size()));
  log.append(header.begin(), header.end()).append(channel).append(data.begin(), data.end());
}

}  // namespace abs_hil::telemetry
