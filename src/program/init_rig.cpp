#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>

#include "config/config_error.hpp"
#include "config/rig_file.hpp"
#include "program/exit_status.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

int init_rig(const RunRequest& request, const std::string& name) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
  if (name.empty() || !std::all_of(name.begin(), name.end(), is_plain)) {
    throw config::ConfigError(fmt::format("init-rig: \"{}\": give a name of letters, digits, - and _", name));
  }
  const std::filesystem::path file = name + ".toml";
  if (std::filesystem::exists(file)) {
    throw config::ConfigError(
        fmt::format("init-rig: {} exists already; give another name or move it away", file.string()));
  }
  std::ofstream stream(file, std::ios::binary);
  stream << config::rig_file(request.settings, name);
  stream.close();
  if (!stream)
    throw config::ConfigError(fmt::format("init-rig: {} cannot be written; choose another folder", file.string()));
  fmt::print("{0}: fill in the values of your rig. Then: abs_hil --plant {0}, abs_hil --backend rig --model {0}\n",
             file.string());
  return exit_completed;
}

}  // namespace abs_hil::program
