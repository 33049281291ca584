// `abs_hil study submit`: an array job and a merge on a Slurm cluster.
#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>

#include "abs_hil/driver/io_result.hpp"
#include "config/config_error.hpp"
#include "files/result_file.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "run_folder/run_folder.hpp"
#include "study/compute.hpp"
#include "study/study_command.hpp"

namespace abs_hil::program {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view jobs_file = "jobs.txt";

/// As a word of a shell.
std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + '\'';
}

struct Printed {
  std::string text{};
  int status{0};
};

/// What a command prints on stdout.
Printed output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "re"), [](FILE*) { return 0; });
  if (!pipe) throw std::runtime_error("cannot start a shell for: " + command);
  Printed printed;
  std::array<char, 4096> block{};
  while (const std::size_t read = std::fread(block.data(), 1, block.size(), pipe.get())) {
    printed.text.append(block.data(), read);
  }
  const int status = ::pclose(pipe.get());
  printed.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return printed;
}

/// Tasks that the cluster takes in one array, whose indices from 1 stay below its MaxArraySize.
std::uint64_t most_tasks() {
  const Printed printed = output_of("scontrol show config 2>/dev/null");
  constexpr std::string_view key = "MaxArraySize";
  const std::size_t at =
      printed.text.find_first_of("0123456789", std::min(printed.text.find(key), printed.text.size()));
  const std::string_view from = std::string_view(printed.text).substr(std::min(at, printed.text.size()));
  const auto size = rig::parse_number<std::uint64_t>(from.substr(0, from.find_first_not_of("0123456789")));
  return size && *size > 1 ? *size - 1 : std::numeric_limits<std::uint64_t>::max();
}

void check_options(const std::vector<std::string>& options) {
  for (const std::string& option : options) {
    if (!option.starts_with('-') || option.find_first_of("\r\n") != std::string::npos) {
      throw config::ConfigError(
          fmt::format("{}: give options of sbatch, each in one word, as in -- --partition=short --time=30", option));
    }
    if (option.starts_with("--array") || option.starts_with("-a") || option.starts_with("--dependency") ||
        option.starts_with("-d")) {
      throw config::ConfigError(fmt::format("{}: array and dependency of the jobs come from --array N", option));
    }
  }
}

std::string script(const std::string& name, const std::string& log, const std::vector<std::string>& own,
                   const std::vector<std::string>& given, const std::string& command) {
  std::string text = fmt::format("#!/bin/sh\n#SBATCH --job-name={}\n#SBATCH --output={}\n", name, log);
  for (const auto* options : {&own, &given}) {
    for (const std::string& option : *options) text += fmt::format("#SBATCH {}\n", option);
  }
  return text + "exec " + command + '\n';
}

std::string submitted(const std::string& options, const fs::path& file) {
  const Printed printed = output_of(fmt::format("sbatch --parsable {}{} 2>&1", options, quoted(file.string())));
  constexpr int not_found = 127;
  if (printed.status == not_found) {
    throw driver::Unavailable(
        fmt::format("sbatch is not here; submit on a computer of the cluster. The scripts are in "
                    "{}",
                    file.parent_path().string()));
  }
  // A line "ID" or "ID;CLUSTER", among what sbatch has to remark.
  std::string id;
  for (const std::string_view line : rig::split(rig::trimmed(printed.text), '\n')) {
    const std::string_view number = line.substr(0, line.find(';'));
    if (rig::parse_number<std::uint64_t>(number)) {
      id = number;
    } else if (printed.status == 0 && !line.empty()) {
      cli::print(stderr, "{}\n", line);
    }
  }
  if (printed.status != 0 || id.empty()) {
    throw driver::Unavailable(fmt::format("sbatch refused {}: {}", file.string(),
                                          rig::refusal(rig::clean_text(rig::trimmed(printed.text)), file,
                                                       "give the options that this cluster wants after --")));
  }
  return id;
}

}  // namespace

int submit_study(const StudyCommand& command) {
  check_options(command.sbatch);
  const fs::path file = fs::absolute(command.file);
  const fs::path path = fs::absolute(study::folder_of(command.file, command.folder));
  if (path.string().find_first_of("\r\n%\\\"") != std::string::npos) {
    throw config::ConfigError(
        fmt::format("--out {}: Slurm takes %, \\, quotes and line ends in paths for something "
                    "else; give a folder without them",
                    path.string()));
  }
  // Everything that is wrong with the study shows here, not in a log on a node.
  const study::Study study = study::make_study(study::load_study(command.file));
  const study::StudyFolder folder(path, study::facts_of(study, file.stem().string()));
  const std::vector<std::uint64_t> missing = study::missing_chunks(folder, {});
  if (missing.empty()) {
    folder.merge({});
    cli::print("study {}: complete, nothing to submit; results: {}/{}\n", file.stem().string(), path.string(),
               study::file::results);
    return exit_completed;
  }
  const auto wanted = std::min<std::uint64_t>(missing.size(), static_cast<std::uint64_t>(command.array));
  const auto tasks = std::min<std::uint64_t>(wanted, most_tasks());
  if (tasks < wanted) {
    cli::print(stderr,
               "abs_hil: --array {}: the cluster takes arrays of at most {} tasks (MaxArraySize), so each does more\n",
               command.array, tasks);
  }
  const std::string program = quoted(fs::read_symlink("/proc/self/exe").string());
  const fs::path slurm = path / "slurm";
  fs::create_directories(slurm);
  const std::string name = run_folder::folder_name(file.stem().string(), path);  // Slurm and a shell take it as it is
  const fs::path array = slurm / "array.sh";
  const fs::path merge = slurm / "merge.sh";
  files::write_result(array, "script",
                      script(name, fmt::format("\"{}/%A_%a.log\"", slurm.string()),
                             {fmt::format("--array=1-{}", tasks), "--requeue", "--open-mode=append"}, command.sbatch,
                             fmt::format("{} study {} --out {} --shard \"$SLURM_ARRAY_TASK_ID/{}\" --threads "
                                         "\"${{SLURM_CPUS_PER_TASK:-1}}\"",
                                         program, quoted(file.string()), quoted(path.string()), tasks)));
  files::write_result(merge, "script",
                      script(name + "-merge", fmt::format("\"{}/%j-merge.log\"", slurm.string()), {"--requeue"},
                             command.sbatch, fmt::format("{} study merge {}", program, quoted(path.string()))));
  if (command.write_only) {
    cli::print("{}\n{}\n", array.string(), merge.string());
    return exit_completed;
  }
  const std::string id = submitted("", array);
  // After any end: chunks that are missing then are named, and computed by the next `submit`.
  const std::string merge_id = submitted(fmt::format("--dependency=afterany:{} ", id), merge);
  std::ofstream(slurm / jobs_file, std::ios::app) << id << '\n' << merge_id << '\n';
  cli::print("study {}: {} chunks in {} tasks of job {}, then merge in job {}; see abs_hil study status {}\n",
             file.stem().string(), missing.size(), tasks, id, merge_id, path.string());
  return exit_completed;
}

std::string slurm_jobs(const std::string& folder) {
  std::ifstream file(fs::path(folder) / "slurm" / jobs_file);
  std::string ids;
  for (std::string id; std::getline(file, id);) {
    if (rig::parse_number<std::uint64_t>(id)) ids += (ids.empty() ? "" : ",") + id;
  }
  if (ids.empty()) return {};
  const Printed printed =
      output_of("squeue --noheader --array --format='job %i: %T %R' --jobs=" + ids + " 2>/dev/null");
  return printed.status == 0 ? printed.text : std::string();
}

}  // namespace abs_hil::program
