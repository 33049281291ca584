// `abs_hil study` and its subcommands as typed.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "cli/command_line.hpp"
#include "program/subcommands.hpp"
#include "study/study.hpp"

namespace abs_hil::program {

/// `abs_hil study` and its subcommands as typed.
struct StudyCommand {
  std::string file{};                   ///< also that of `submit`
  std::optional<std::string> folder{};  ///< --out, also of `submit`; the folder of `status`
  std::optional<std::string> shard{};   ///< "I/N"
  std::size_t threads{0};               ///< 0: one for each processor
  std::optional<int> run{};             ///< --run
  cli::Parser parser{};

  std::vector<std::string> merged{};  ///< folders of `merge`; the results go into the first
  cli::Parser merge{};

  cli::Parser status{};

  int array{0};
  bool write_only{false};
  std::vector<std::string> sbatch{};
  cli::Parser submit{};
};

Action add_compare(cli::Parser& parser, const Words& words);
Action add_study(cli::Parser& parser, const Words& words);

/// Repeats one run of a study with everything recorded in a run folder, as `abs_hil --fast --out FOLDER` does: from the
/// beginning to the end of its experiment. Its config.toml repeats it once more. Returns the run's exit status.
/// @param folder  new or empty; none: a new one below the folder of runs
/// Throws config::ConfigError unless the study has a run of this number, and what `run` throws.
int record_run(const study::Study& study, std::uint64_t number, const std::optional<std::string>& folder,
               const std::vector<std::string>& command_line);

/// `abs_hil study submit`: writes the scripts of an array job and of the job that merges, and hands them to Slurm.
int submit_study(const StudyCommand& command);
/// What Slurm says about the jobs of a study's folder: a line each; empty without jobs and without Slurm.
[[nodiscard]] std::string slurm_jobs(const std::string& folder);

/// A signal came while many runs were computed.
struct Interrupted {
  std::uint64_t done{0};  ///< runs that are complete
};

/// Shows the progress of many runs on stderr if that is a terminal: how many, how fast, how long it will take. Silent
/// otherwise. While it lives, a first signal (SIGINT, SIGTERM, SIGHUP) makes `show` throw Interrupted; a second one
/// ends the program at once. Thread-safe.
class RunProgress {
 public:
  RunProgress();
  /// Clears the line.
  ~RunProgress();
  /// The first call begins the count of what is done now. @throws Interrupted  after a signal
  void show(std::uint64_t done, std::uint64_t all);

 private:
  using Clock = std::chrono::steady_clock;

  bool terminal_;
  std::optional<std::uint64_t> earlier_{};
  Clock::time_point start_{Clock::now()};
  Clock::time_point shown_{};
  std::mutex mutex_{};
};

}  // namespace abs_hil::program
