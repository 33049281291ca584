// `abs_hil study` with merge, status and submit, and the progress of many runs.
#include "study/study_command.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "config/config_error.hpp"
#include "program/extra.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "study/compute.hpp"

namespace abs_hil::program {

namespace {

void add_submit(cli::Parser& study, StudyCommand& command) {
  command.submit = study.add_subcommand("submit", "compute a study on a Slurm cluster: an array job, then a merge");
  command.submit.add("file", &command.file, "the study", {.type = "FILE", .required = true});
  command.submit.add("--array", &command.array, "tasks of the array job",
                     {.type = "N", .range = {1, 1'000'000}, .required = true});
  command.submit.add("--out", &command.folder, "folder of the study, on a file system that all nodes share",
                     {.type = "DIR"});
  command.submit.add("--write-only", &command.write_only, "write the scripts, and do not call sbatch");
  command.submit.add("options", &command.sbatch, "options of sbatch for both jobs, after --", {.type = "OPTION"});
}

void add_options(StudyCommand& command) {
  command.parser.add("file", &command.file, "the study (docs/studies.md)", {.type = "FILE"});
  command.parser.add("--out", &command.folder,
                     "folder of the results (default: one of the study's name below runs/); with --run that "
                     "of the run",
                     {.type = "DIR"});
  add_threads(command.parser, command.threads);
  command.parser.add("--shard", &command.shard, "compute the I-th of N parts only; `merge` puts the parts together",
                     {.type = "I/N"});
  command.parser.add("--run", &command.run, "repeat one run with everything recorded in a run folder",
                     {.type = "K", .range = {0, 2'000'000'000}, .excludes = {"--shard"}});
  command.merge = command.parser.add_subcommand("merge", "put the parts of a study together");
  command.merge.add("folder", &command.merged, "folders with parts; the results go into the first",
                    {.type = "DIR", .required = true});
  command.status = command.parser.add_subcommand("status", "how much of a study is done");
  command.status.add("folder", &command.folder, "folder of a study", {.type = "DIR", .required = true});
  add_submit(command.parser, command);
}

/// "420 ms", "1.6 s", "12 s", "3 min", "5.2 h".
std::string duration_text(double seconds) {
  if (seconds < 1.0) return fmt::format("{:.0f} ms", 1e3 * seconds);
  if (seconds < 90.0) return fmt::format("{:.{}f} s", seconds, seconds < 10.0 ? 1 : 0);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

study::Shard read_shard(const std::string& text) {
  const std::string_view words = text;
  const std::size_t slash = std::min(words.find('/'), words.size());
  const auto number = rig::parse_number<std::uint64_t>(words.substr(0, slash));
  const auto of = rig::parse_number<std::uint64_t>(words.substr(std::min(slash + 1, words.size())));
  if (number && of && *number >= 1 && *number <= *of) return {*number, *of};
  throw config::ConfigError(
      fmt::format("--shard {}: give I/N with 1 <= I <= N, as in --shard 3/8 for the third of eight parts", text));
}

int run_study(const StudyCommand& command) {
  const study::Shard shard = command.shard ? read_shard(*command.shard) : study::Shard{};
  const auto start = std::chrono::steady_clock::now();
  study::Tally tally;
  std::uint64_t of_all = 0;
  try {
    RunProgress progress;
    tally = study::run(command.file, command.folder, {.shard = shard, .threads = command.threads},
                       [&](std::uint64_t done, std::uint64_t all) { progress.show(done, of_all = all); });
  } catch (const Interrupted& interrupted) {
    const std::string path = study::folder_of(command.file, command.folder);
    spdlog::warn(
        "interrupted after {} of {} runs. {} keeps each chunk that is complete ({} runs each); the same command goes "
        "on from there, and `abs_hil study status {}` shows how much is done",
        interrupted.done, of_all, path, study::StudyFolder(path).facts().chunk, path);
    return status_of(signalled());
  }
  const std::string name = std::filesystem::path(command.file).stem().string();
  const std::string path = study::folder_of(command.file, command.folder);
  if (tally.runs == 0 && shard.of == 1) {
    cli::print("study {}: complete already; results: {}/{}\n", name, path, study::file::results);
    return exit_completed;
  }
  const double spent_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::string now = tally.earlier > 0 ? fmt::format(", {} of them now", tally.runs) : "";
  cli::print("study {}: {} runs{} in {}, {:.0f} runs/s; {}{} ended by a fault, {} refused\n", name,
             tally.earlier + tally.runs, now, duration_text(spent_s),
             spent_s > 0.0 ? static_cast<double>(tally.runs) / spent_s : 0.0, now.empty() ? "" : "of these ",
             tally.faults, tally.refused);
  if (!tally.damaged.empty()) spdlog::warn("damaged chunks were computed anew: {}", study::list_of(tally.damaged));
  if (tally.refused > 0) {
    spdlog::warn("{} runs could not begin; the column `reason` of the results says why", tally.refused);
  }
  if (shard.of == 1) {
    cli::print("results: {}/{}\n", path, study::file::results);
  } else {
    cli::print("part {} of {} is done, in {}; when all are: abs_hil study merge {}\n", shard.number, shard.of, path,
               path);
  }
  return exit_completed;
}

int merge_study(const std::vector<std::string>& folders) {
  const study::StudyFolder first(folders.front());
  const std::vector<study::StudyFolder> others(folders.begin() + 1, folders.end());
  first.merge(others);
  cli::print("results: {}/{}, {} runs\n", first.path().string(), study::file::results, first.facts().runs);
  return exit_completed;
}

int show_status(const std::string& path) {
  const study::StudyFolder folder(path);
  const study::StudyFacts& facts = folder.facts();
  const std::uint64_t chunks = facts.chunks();
  if (folder.complete()) {
    cli::print("study {}: complete, {} runs in {}/{}\n", facts.name, facts.runs, path, study::file::results);
  } else {
    const std::vector<std::uint64_t> missing = study::missing_chunks(folder, {});
    std::uint64_t left = 0;
    for (const std::uint64_t chunk : missing) left += facts.runs_in(chunk);
    const std::uint64_t done = facts.runs - left;
    cli::print("study {}: {} of {} runs ({:.1f} %), {} of {} chunks, in {}\n", facts.name, done, facts.runs,
               100.0 * static_cast<double>(done) / static_cast<double>(facts.runs), chunks - missing.size(), chunks,
               path);
    if (missing.empty()) {
      cli::print("all chunks are there; put them together: abs_hil study merge {}\n", path);
    } else {
      cli::print("missing chunks: {}\n", study::list_of(missing));
      const std::vector<std::uint64_t> damaged = study::damaged_of(missing, folder);
      if (!damaged.empty()) {
        cli::print("of these damaged: {}; the study computes them anew when it goes on\n", study::list_of(damaged));
      }
    }
  }
  cli::print("{}", slurm_jobs(path));
  return exit_completed;
}

constexpr auto least_pause = std::chrono::milliseconds(100);
constexpr double believable_after_s = 2.0;

int study(const StudyCommand& command, const std::vector<std::string>& command_line) {
  const bool below = command.merge.parsed() || command.status.parsed() || command.submit.parsed();
  if (below && !command.parser.given().empty()) {
    throw config::ConfigError(fmt::format("{}: give options of a subcommand of `abs_hil study` after its name",
                                          command.parser.given().front()));
  }
  if (command.merge.parsed()) return merge_study(command.merged);
  if (command.status.parsed()) return show_status(*command.folder);
  if (command.submit.parsed()) return submit_study(command);
  if (command.file.empty()) {
    throw config::ConfigError("study: give a study, a TOML file (docs/studies.md), or merge, status or submit");
  }
  if (!command.run) return run_study(command);
  return record_run(study::make_study(study::load_study(command.file)), static_cast<std::uint64_t>(*command.run),
                    command.folder, command_line);
}

}  // namespace

Action add_study(cli::Parser& parser, const Words& words) {
  const auto command = std::make_shared<StudyCommand>();
  command->parser = parser;
  add_options(*command);
  return [command, words] { return study(*command, words); };
}

int record_run(const study::Study& study, std::uint64_t number, const std::optional<std::string>& folder,
               const std::vector<std::string>& command_line) {
  RunRequest request{config::configuration_of(study::settings_of_run(study, number))};
  request.outputs = {.no_lcm = true, .run_folder = folder};
  request.virtual_time = true;
  request.command_line = command_line;
  return run(request);
}

RunProgress::RunProgress() : terminal_(isatty(STDERR_FILENO) == 1) { note_signals(true); }

RunProgress::~RunProgress() {
  if (terminal_) std::fputs("\r\033[K", stderr);
}

void RunProgress::show(std::uint64_t done, std::uint64_t all) {
  if (signalled() != rig::Reason::none) throw Interrupted{done};
  if (!terminal_) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  const auto now = Clock::now();
  if (!lock || now - shown_ < least_pause) return;
  shown_ = now;
  if (!earlier_) earlier_ = done;
  const double spent_s = std::chrono::duration<double>(now - start_).count();
  const double rate_Hz = static_cast<double>(done - *earlier_) / spent_s;
  // Threads begin with many runs at once, which end together: the first seconds tell no rate.
  const std::string left =
      spent_s < believable_after_s
          ? ""
          : fmt::format(", {:.0f} runs/s, {} left", rate_Hz, duration_text(static_cast<double>(all - done) / rate_Hz));
  cli::print(stderr, "\r\033[K{} of {} runs{}", done, all, left);
  std::fflush(stderr);
}

namespace {
constexpr std::array rows{
    Subcommand{"compare", "compare controllers in simulation on the same varied plants", &add_compare},
    Subcommand{"study", "simulate the runs that a file describes; repeat the command to go on after an interruption",
               &add_study}};
}  // namespace

extern const Extra study_extra;
constinit const Extra study_extra{.name = "study", .subcommands = rows};

}  // namespace abs_hil::program
