// Reads LCM event logs, with checks of sync words, lengths and numbers.
#include "telemetry/event_log.hpp"

#include <array>
#include <boost/endian/conversion.hpp>
#include <cerrno>
#include <cstring>
#include <limits>

namespace abs_hil::telemetry {
namespace {

constexpr std::uint32_t sync_word = 0xEDA1DA01;
constexpr std::size_t header_bytes = 28;  // sync, number, timestamp, length of channel, length of data
constexpr std::uint32_t channel_max_bytes = 63;
constexpr std::uint32_t data_max_bytes = 1U << 28U;  // LCM's own limit

}  // namespace

EventLogReader::EventLogReader(std::filesystem::path path) : path_(std::move(path)), file_(path_, std::ios::binary) {
  std::error_code error;
  if (file_) size_ = std::filesystem::file_size(path_, error);
  if (!file_ || error) {
    throw RecordingError("'" + path_.string() +
                         "': " + (file_.is_open() ? "not a regular file" : std::strerror(errno)) +
                         "; give an LCM event log (.lcmlog), as --log writes it");
  }
}

std::string EventLogReader::place(const std::string& what) const {
  return "'" + path_.string() + "': event " + std::to_string(events_) + " at byte " + std::to_string(at_) + ": " + what;
}

/// A log ends in the middle of a message. If another message follows, it is a damaged length that says so.
std::optional<LogEvent> EventLogReader::end_cut_off() {
  if (events_ == 0) fail("not an LCM event log");
  file_.clear();
  if (!file_.seekg(static_cast<std::streamoff>(at_ + sizeof sync_word))) fail(std::strerror(errno));
  std::uint32_t last = 0;
  for (char byte = 0; file_.get(byte);) {
    last = last << 8U | static_cast<unsigned char>(byte);
    if (last == sync_word) fail("the file is damaged: its length reaches beyond the end, but other events follow");
  }
  cut_ = place("the file is cut off, as that of a program that was killed; it is read up to here");
  return std::nullopt;
}

std::optional<LogEvent> EventLogReader::next() {
  std::array<std::uint8_t, header_bytes> header{};
  const auto read_into = [this](void* to, std::size_t size) {
    file_.read(static_cast<char*>(to), static_cast<std::streamsize>(size));
    return static_cast<std::size_t>(file_.gcount());
  };
  const std::size_t read = read_into(header.data(), header.size());
  if (read == 0 && file_.eof()) return std::nullopt;
  if (read >= sizeof sync_word && boost::endian::load_big_u32(header.data()) != sync_word) {
    fail(events_ == 0 ? "not an LCM event log" : "the file is damaged: no event begins here");
  }
  if (read != header.size()) return end_cut_off();
  LogEvent event;
  event.number = boost::endian::load_big_s64(&header[4]);
  event.timestamp_us = boost::endian::load_big_s64(&header[12]);
  const std::uint32_t channel_bytes = boost::endian::load_big_u32(&header[20]);
  const std::uint32_t data_bytes = boost::endian::load_big_u32(&header[24]);
  if (channel_bytes == 0 || channel_bytes > channel_max_bytes || data_bytes > data_max_bytes) {
    fail("the file is damaged: these lengths are not valid");
  }
  if (event.number < events_) fail("the file is damaged: event number " + std::to_string(event.number));
  // Checked before memory is allocated, because a damaged length may have any value.
  if (size_ - at_ < header_bytes + std::uint64_t{channel_bytes} + data_bytes) return end_cut_off();
  event.channel.resize(channel_bytes);
  event.data.resize(data_bytes);
  if (read_into(event.channel.data(), channel_bytes) != channel_bytes ||
      read_into(event.data.data(), data_bytes) != data_bytes) {
    fail("it changed while it was read");
  }
  at_ += header_bytes + channel_bytes + data_bytes;
  events_ = event.number == std::numeric_limits<std::int64_t>::max() ? event.number : event.number + 1;
  return event;
}

std::string for_each_event(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& take) {
  EventLogReader reader(log);
  while (const auto event = reader.next()) take(*event);
  return reader.cut();
}

void append_event(std::string& log, std::int64_t number, std::int64_t timestamp_us, std::string_view channel,
                  std::span<const std::uint8_t> data) {
  std::array<std::uint8_t, header_bytes> header{};
  boost::endian::store_big_u32(header.data(), sync_word);
  boost::endian::store_big_s64(&header[4], number);
  boost::endian::store_big_s64(&header[12], timestamp_us);
  boost::endian::store_big_u32(&header[20], static_cast<std::uint32_t>(channel.size()));
  boost::endian::store_big_u32(&header[24], static_cast<std::uint32_t>(data.size()));
  log.append(header.begin(), header.end()).append(channel).append(data.begin(), data.end());
}

}  // namespace abs_hil::telemetry
