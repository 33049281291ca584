#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "telemetry/outlet.hpp"
#include "telemetry/record_file.hpp"

namespace abs_hil::telemetry {

/// A file cannot be read as a recording: it is of another kind, damaged or incomplete. `what()` names file, place and
/// reason.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Of an event: sync, number, timestamp, length of channel, length of data.
inline constexpr std::size_t event_header_bytes = 28;

/// One event of an LCM event log.
struct LogEvent {
  std::size_t part{0};  ///< recordings in one file, from 0: `lcm-logger --append` numbers its events from 0 again
  std::int64_t number{0};
  std::int64_t timestamp_us{0};  ///< since 1970
  std::string channel{};
  std::vector<std::uint8_t> data{};
};

/// Reads LCM's event logs. It checks sync words, lengths and event numbers. lcm::LogFile skips damage silently instead.
/// A killed program leaves a part of a message at the end of its log: there the log, or this part of it, ends, and
/// `cut` says so.
class EventLogReader {
 public:
  /// Throws RecordingError when the file cannot be opened.
  explicit EventLogReader(std::filesystem::path path);

  /// Returns the next event, or nothing at the end. Throws RecordingError if the file is damaged.
  [[nodiscard]] std::optional<LogEvent> next();
  /// After the end: where messages are cut off, in words; empty if all are whole.
  [[nodiscard]] const std::string& cut() const noexcept { return cut_; }

 private:
  [[nodiscard]] std::string place(const std::string& what) const;
  [[noreturn]] void fail(const std::string& what) const { throw RecordingError(place(what)); }
  enum class Behind : std::uint8_t { nothing, events, recording };
  std::size_t read_into(void* to, std::size_t size);
  [[nodiscard]] bool header_begins() const;
  Behind look_behind(std::uint64_t end);
  void note_cut(const std::string& what) {
    constexpr std::size_t longest = 1000;
    if (cut_.size() < longest) cut_.append(cut_.empty() ? "" : "; ").append(place(what));
  }
  std::optional<std::string> read_event(LogEvent& event);

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_{0};
  std::array<std::uint8_t, event_header_bytes> header_{};  ///< of the event at `at_`, read ahead
  std::size_t header_read_{0};
  std::uint64_t at_{0};
  std::size_t part_{0};
  std::int64_t events_{0};  ///< least number of the next event
  std::string cut_{};
};

/// Calls `take` for every event of a log, in order. Returns EventLogReader::cut. Throws RecordingError, even after some
/// calls.
std::string for_each_event(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& take);

/// Tells the runs of a recording apart: one after another, in appended recordings, of several rigs at once. Runs have
/// numbers from 0 in the order in which they begin in the file.
///
/// A telemetry_t belongs to the run of its channel's prefix that began at the same instant of the monotonic clock, if
/// its cycle is later than the run's last one, or to a run whose sequence it continues. Any other telemetry_t begins a
/// run, and so does an experiment_t with sequence 0. Other events belong to the run of their prefix that was heard
/// last; without one, to the run of the file that began last.
class RunSeparator {
 public:
  /// The event's run; 0 before the first run begins.
  std::size_t run_of(const LogEvent& event);
  /// Number of runs that have begun.
  [[nodiscard]] std::size_t runs() const noexcept { return runs_.size(); }

 private:
  struct Run {
    std::string prefix{};
    std::size_t heard{0};            ///< number of the event that was heard last
    bool described{false};           ///< by an experiment_t
    std::uint64_t start_ns{0};       ///< on the monotonic clock
    std::int64_t first_stamp_ns{0};  ///< of the first telemetry_t
    bool heard_cycle{false};         ///< a telemetry_t
    std::int64_t cycle{0};           ///< of the last one
    std::int64_t sequence{0};
  };
  std::vector<Run> runs_{};
  std::size_t events_{0};
};

/// A recording as a command names it: FILE, or FILE#N for one of its runs.
struct NamedRecording {
  explicit NamedRecording(const std::string& name);

  std::string path;
  std::size_t run{0};  ///< from 1; 0: the only one
};

/// Which of `runs` runs is meant, from 0. Throws RecordingError, with what to give, if none is named and there are
/// several, or if there are fewer.
[[nodiscard]] std::size_t chosen_run(const NamedRecording& recording, std::size_t runs);

/// Appends an event to the bytes of a log, as LCM does.
void append_event(std::string& log, std::int64_t number, std::int64_t timestamp_us, std::string_view channel,
                  std::span<const std::uint8_t> data);

/// Time since 1970 in us, as in LCM's stamps.
[[nodiscard]] inline std::int64_t wall_clock_us() {
  using std::chrono::duration_cast, std::chrono::microseconds, std::chrono::system_clock;
  return duration_cast<microseconds>(system_clock::now().time_since_epoch()).count();
}

/// Writes an LCM event log as lcm-logger does (RecordFile). lcm-logplayer and lcm-spy can read it. Each cycle takes
/// about 0.4 kB.
class LogOutlet : public Outlet {
 public:
  /// Event times are `epoch_us` plus run time, us since 1970. Without an epoch it is the
  /// wall clock at the first message minus its run time. So the times keep the spacing of the cycles, however late the
  /// ring is emptied. Give an epoch for virtual time: then every run gives the same file.
  /// Throws files::FileError when the file cannot be opened.
  /// @param write_period_s  longest run time until a message is written, so that a killed program loses no older
  ///                        messages; the first of these writes replaces an older file. 0: messages are written when a
  ///                        block of 64 KiB is full, and the file appears when it is whole
  explicit LogOutlet(std::filesystem::path path, std::optional<std::int64_t> epoch_us = std::nullopt,
                     double write_period_s = 0.0)
      : file_(std::move(path), "event log", write_period_s > 0.0),
        epoch_us_(epoch_us),
        write_period_s_(write_period_s) {}

  void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept override {
    const std::int64_t run_time_us = std::llround(time_s * 1e6);
    if (!epoch_us_) epoch_us_ = wall_clock_us() - run_time_us;
    event_.clear();
    append_event(event_, next_number_++, *epoch_us_ + run_time_us, channel, message);
    const bool due = write_period_s_ > 0.0 && time_s - last_write_s_ >= write_period_s_;
    if (due) last_write_s_ = time_s;
    file_.append(event_, due);
  }
  void finish() override { file_.finish(); }
  [[nodiscard]] std::uint64_t failures() const noexcept override { return file_.lost(); }

 private:
  RecordFile file_;
  std::string event_{};  ///< the latest, in the file's form
  std::optional<std::int64_t> epoch_us_;
  std::int64_t next_number_{0};
  double write_period_s_;
  double last_write_s_{0.0};
};

}  // namespace abs_hil::telemetry
