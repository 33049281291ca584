// Runs the members of a series one after the other, with a pause in between, and keeps its folder.
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <ctime>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "abs_hil/driver/io_result.hpp"
#include "config/config_error.hpp"
#include "config/script.hpp"
#include "program/extra.hpp"
#include "run/parallel.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::program {

namespace {

using Clock = std::chrono::steady_clock;

/// Shows the progress of a series of runs on stderr: one changing line on a terminal, else one line for every tenth.
class Progress {
 public:
  /// @param pause_s  pause between two runs; 0: none
  Progress(std::size_t runs, std::size_t done, double pause_s)
      : runs_(runs), done_(done), at_start_(done), pause_s_(pause_s) {}

  /// @param what  the run @param phase  its current phase; empty: the run has ended
  void show(const std::string& what, std::string_view phase, bool at_once = false) {
    const std::scoped_lock lock(mutex_);
    const auto now = Clock::now();
    if (!terminal_ || (!phase.empty() && !at_once && now - shown_ < std::chrono::milliseconds(100))) return;
    shown_ = now;
    cli::print(stderr, "\r\033[K{} of {} runs, {} left; {}{}{}", done_, runs_, left(), what, phase.empty() ? "" : ": ",
               phase);
    std::fflush(stderr);
  }
  void count(const std::string& what) {
    {
      const std::scoped_lock lock(mutex_);
      ++done_;
      const std::size_t tenth = std::max<std::size_t>(1, runs_ / 10);
      if (!terminal_ && (done_ % tenth == 0 || done_ == runs_)) {
        cli::print(stderr, "{} of {} runs, {} left\n", done_, runs_, left());
      }
    }
    show(what, {});
  }
  void paused() {
    const std::scoped_lock lock(mutex_);
    ++pauses_;
  }
  [[nodiscard]] std::size_t done() const noexcept { return done_; }
  void end() const {
    if (terminal_) cli::print(stderr, "\r\033[K");
  }

 private:
  [[nodiscard]] std::string left() const {
    if (done_ == at_start_) return "? s";
    const double spent_s = std::chrono::duration<double>(Clock::now() - start_).count() - pauses_ * pause_s_;
    const double runs_s = spent_s / static_cast<double>(done_ - at_start_) * static_cast<double>(runs_ - done_);
    const double left_s = runs_s + (static_cast<double>(runs_ - at_start_ - 1) - pauses_) * pause_s_;
    return left_s < 90.0 ? fmt::format("{:.0f} s", left_s) : fmt::format("{:.0f} min", left_s / 60.0);
  }

  std::size_t runs_;
  std::size_t done_;
  std::size_t at_start_;
  double pause_s_;
  int pauses_{0};  ///< number of completed pauses
  bool terminal_{isatty(STDERR_FILENO) == 1};
  Clock::time_point start_{Clock::now()};
  Clock::time_point shown_{};
  std::mutex mutex_{};
};

/// The options of one run of the series.
RunOptions one_of(const RunOptions& common, const config::SeriesMember& member) {
  RunOptions options = common;
  config::choose(member, options);
  return options;
}

std::string text_of(const config::SeriesMember& member) {
  std::string text;
  for (const auto& [key, value] : member.varied) text += fmt::format("{} = {}, ", key, config::text_of(value));
  return text + fmt::format("seed {}", member.seed);
}

/// Opens the folder of the series; null if no folder is wanted. Throws config::ConfigError.
std::unique_ptr<run_folder::SeriesFolder> open_folder(const RunRequest& base,
                                                      std::vector<run_folder::SeriesEntry> entries) {
  const OutputOptions& o = base.outputs;
  std::unique_ptr<run_folder::SeriesFolder> folder;
  std::filesystem::path path;
  if (o.run_folder) {
    path = *o.run_folder;
  } else {
    const std::filesystem::path runs = run_folder::default_runs_dir();
    if (o.no_run_folder || runs.empty()) return folder;
    path = run_folder::unused_folder(runs, fmt::localtime(std::time(nullptr)), base.settings.experiment.name);
  }
  try {
    folder = std::make_unique<run_folder::SeriesFolder>(
        path, run_folder::sha256_of(base.json + base.settings.plant_name + base.settings.backend), base.script->name,
        std::move(entries));
  } catch (const std::runtime_error& error) {
    throw config::ConfigError(error.what());
  }
  return folder;
}

/// Waits in real time between two runs of a series, so that the brake cools. A signal or a `stop` on the LCM network of
/// `run` (not with --no-lcm) ends the wait. A stop is answered as during a run.
/// @param run  the run that has ended
/// @return the reason to end the series; `none` after the whole pause
/// Throws telemetry::LcmError without a network.
rig::Reason pause_between_runs(const RunRequest& run, double duration_s) {
  std::vector<StopHeard> listeners;
  for (const Extra* extra : extras()) {
    if (extra->pause != nullptr && !run.outputs.no_lcm) listeners.push_back(extra->pause(run));
  }
  const auto start = Clock::now();
  while (true) {
    const auto now = Clock::now();
    const double time_s = std::chrono::duration<double>(now - start).count();
    if (signalled() != rig::Reason::none) return signalled();
    if (std::ranges::any_of(listeners, [&](const auto& one) { return one(now, time_s); })) {
      return rig::Reason::stop_command;
    }
    if (time_s >= duration_s) return rig::Reason::none;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

/// True if a signal ended the run: then it must be repeated.
bool is_interrupted(int status) { return status > 128; }

/// Carries out the remaining runs of a series.
class SeriesRun {
 public:
  /// @param folder  may be null; all arguments must outlive it
  SeriesRun(const RunOptions& common, const RunRequest& base, const std::vector<config::SeriesMember>& members,
            run_folder::SeriesFolder* folder)
      : common_(common),
        base_(base),
        members_(members),
        folder_(folder),
        left_(left_of(members.size(), folder)),
        pause_s_(base.virtual_time ? 0.0 : base.script->series.pause_s),
        progress_(members.size(), members.size() - left_.size(), pause_s_) {
    for (std::size_t i = 0; folder != nullptr && i < members.size(); ++i) {
      if (folder->done(i) && folder->status(i) != completed) ++ended_early_;
    }
    if (folder != nullptr && folder->resumed()) {
      spdlog::info("{} of {} runs are already recorded", members.size() - left_.size(), members.size());
    }
  }

  /// Carries out the runs. Returns the program's exit status.
  int run_all() {
    // In virtual time one run per processor at a time; on the rig one after the other.
    const bool at_once = base_.virtual_time && base_.settings.backend == "sim";
    run::for_each_index(left_.size(), at_once ? run::machine_threads() : 1, [this](std::size_t k) { run_one(k); });
    progress_.end();
    if (interrupted_ == 0 && signalled() != rig::Reason::none) interrupted_ = status_of(signalled());
    cli::print("{}\n", in_words());
    if (interrupted_ != 0) return interrupted_;
    return ended_early_ == 0 && !cut_short() ? exit_completed : exit_ended_early;
  }

 private:
  static constexpr const char* completed = "completed";

  static std::vector<std::size_t> left_of(std::size_t runs, const run_folder::SeriesFolder* folder) {
    std::vector<std::size_t> left;
    for (std::size_t i = 0; i < runs; ++i) {
      if (folder == nullptr || !folder->done(i)) left.push_back(i);
    }
    return left;
  }

  void run_one(std::size_t k) {
    if (interrupted_ != 0 || halted_by_ != 0 || stopped_ || signalled() != rig::Reason::none) return;
    const std::size_t i = left_[k];
    const std::string what = fmt::format("{}, {}", run_folder::SeriesFolder::name_of(i), text_of(members_[i]));
    RunRequest request = merge(one_of(common_, members_[i]));
    request.command_line = base_.command_line;
    request.in_series = [this, &what](std::string_view phase) { progress_.show(what, phase); };
    request.stop_was_sent = [this] { stopped_ = true; };
    request.outputs.run_folder.reset();
    request.outputs.no_run_folder = true;
    bool moved = k > 0;
    try {
      if (folder_ != nullptr) request.outputs.run_folder = folder_->begin(i).string();
      const int status = run(request);
      moved = true;
      if (is_interrupted(status)) {
        interrupted_ = status;
        return;
      }
      if (folder_ != nullptr && !folder_->end(i, status == exit_completed ? completed : "fault")) return lose(i);
      if (status != exit_completed) {
        ++ended_early_;
        // After a fault of the rig or a stop command a person must look before anything moves again.
        if (base_.settings.backend == "rig") halted_by_ = i + 1;
      }
    } catch (const driver::Unavailable&) {
      throw;
    } catch (const telemetry::LcmError&) {
      throw;
    } catch (const std::exception& error) {
      // As an error of the usage it would say that nothing has moved.
      if (!moved) throw;
      spdlog::error("{}", error.what());
      return lose(i);
    }
    progress_.count(what);
    if (pause_s_ > 0.0 && k + 1 < left_.size() && halted_by_ == 0 && !stopped_) {
      progress_.show(what, fmt::format("ended; pause of {:.6g} s before the next run", pause_s_), true);
      const rig::Reason reason = pause_between_runs(request, pause_s_);
      if (reason == rig::Reason::none) progress_.paused();
      if (reason == rig::Reason::stop_command) stopped_ = true;
    }
  }

  /// Ends the series: the next run would lose its record, too.
  void lose(std::size_t i) {
    lost_ = true;
    halted_by_ = i + 1;
  }

  /// True if some runs were not done.
  [[nodiscard]] bool cut_short() const {
    return interrupted_ != 0 || ((halted_by_ != 0 || stopped_) && progress_.done() < members_.size());
  }

  [[nodiscard]] std::string in_words() const {
    const std::string where = folder_ != nullptr ? ", in " + folder_->path().string() : std::string();
    if (!cut_short()) {
      return fmt::format("series {}: {} runs, {} ended early{}", base_.script->name, members_.size(),
                         ended_early_.load(), where);
    }
    std::string why = "interrupted";
    if (interrupted_ == 0) {
      why = stopped_ ? "ended by a stop command"
                     : fmt::format("ended because {} {}", run_folder::SeriesFolder::name_of(halted_by_ - 1),
                                   lost_ ? "has no complete record" : "ended early");
    }
    return fmt::format(
        "series {}: {} with {} of {} runs done, {} ended early{}{}", base_.script->name, why, progress_.done(),
        members_.size(), ended_early_.load(), where,
        folder_ != nullptr ? "; to continue, repeat the command with --out " + folder_->path().string() : "");
  }

  const RunOptions& common_;
  const RunRequest& base_;
  const std::vector<config::SeriesMember>& members_;
  run_folder::SeriesFolder* folder_;
  std::vector<std::size_t> left_;
  double pause_s_;
  Progress progress_;
  std::atomic<std::size_t> ended_early_{0};
  std::atomic<int> interrupted_{0};
  std::atomic<bool> stopped_{false};       ///< a stop command arrived, during a run or between two runs
  std::atomic<bool> lost_{false};          ///< the record of a run is not complete
  std::atomic<std::size_t> halted_by_{0};  ///< number of the run that ended the series, from 1; 0: none
};

}  // namespace

int run_series(const RunOptions& common, const RunRequest& base) {
  if (base.outputs.names_files()) {
    throw config::ConfigError(fmt::format(
        "{}: a series of runs does not fit in one file; give --out DIR in place of --csv, --log, --summary and "
        "--histogram",
        base.script->path));
  }
  if (base.outputs.prior_file) {
    throw config::ConfigError(
        fmt::format("{}: a series of runs, which must not depend on each other; leave out --prior {}",
                    base.script->path, *base.outputs.prior_file));
  }
  const std::vector<config::SeriesMember> members = config::members_of(*base.script, base.settings.seed);
  std::vector<run_folder::SeriesEntry> entries;
  // Check every run's configuration before the first run moves anything.
  for (const config::SeriesMember& member : members) {
    const RunRequest one = merge(one_of(common, member));
    if (!base.script->series.experiments.empty()) config::refuse_nested(*base.script, *one.script);
    check_questions(one);
    entries.push_back({.varied = config::varied_json(member), .seed = member.seed});
  }
  const std::unique_ptr<run_folder::SeriesFolder> folder = open_folder(base, std::move(entries));
  note_signals();
  return SeriesRun(common, base, members, folder.get()).run_all();
}

}  // namespace abs_hil::program
