// Facts of program and computer for environment.json.
#include "run_folder/environment.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>
#ifndef _WIN32
#include <sys/utsname.h>
#endif

#include "abs_hil_revision.hpp"

namespace abs_hil::run_folder {

namespace {

std::string processor_model() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

struct System {
  std::string host{"unknown"};
  std::string kernel{"unknown"};
  std::string machine{"unknown"};
};

System system_facts() {
#ifdef _WIN32
  const char* host = std::getenv("COMPUTERNAME");
  const char* machine = std::getenv("PROCESSOR_ARCHITECTURE");
  return {.host = host != nullptr ? host : "unknown",
          .kernel = "Windows",
          .machine = machine != nullptr ? machine : "unknown"};
#else
  utsname system{};
  if (::uname(&system) != 0) return {};
  return {system.nodename, fmt::format("{} {} {}", system.sysname, system.release, system.version), system.machine};
#endif
}

}  // namespace

BuildFacts build_facts() {
#ifdef __clang__
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "gcc " __VERSION__;
#endif
  return {ABS_HIL_VERSION, ABS_HIL_REVISION, ABS_HIL_BUILD_TYPE, compiler};
}

nlohmann::ordered_json environment_json(const RunEnvironment& run) {
  const BuildFacts build = build_facts();
  const System system = system_facts();
  std::error_code ignored;
  return {
      {"date_utc", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)))},
      {"command_line", run.command_line},
      {"working_directory", std::filesystem::current_path(ignored).string()},
      {"version", build.version},
      {"git_revision", build.git_revision},
      {"build_type", build.build_type},
      {"compiler", build.compiler},
      {"host", system.host},
      {"kernel", system.kernel},
      {"machine", system.machine},
      {"processor", processor_model()},
      {"processors", std::thread::hardware_concurrency()},
      {"backend", run.backend},
      {"board", {{"name", run.board}, {"emulated", run.emulated}, {"notes", run.board_notes}}},
      {"real_time",
       {{"virtual_time", run.virtual_time}, {"obtained", run.realtime}, {"shortcomings", run.realtime_shortcomings}}}};
}

}  // namespace abs_hil::run_folder
