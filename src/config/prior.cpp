// Reads and writes priors. Their keys and ranges are those of the configuration.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>

#include "config/config_error.hpp"
#include "config/merge.hpp"

namespace abs_hil::config {
namespace {

constexpr std::int64_t format = 1;

}  // namespace

std::vector<FileValue> read_prior(const std::filesystem::path& file, std::string_view model) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error) return {};
  std::vector<FileValue> values = read_file(file);
  const auto refuse = [&](const std::string& why) {
    throw ConfigError(
        fmt::format("--prior {}: {}; give the file that a run with --prior has written, or remove it to begin anew",
                    file.string(), why));
  };
  const auto taken = [&](std::string_view name) {
    const auto found = std::ranges::find(values, name, &FileValue::name);
    if (found == values.end()) refuse(fmt::format("has no {}", name));
    const Value value = found->value;
    values.erase(found);
    return value;
  };
  if (taken("prior.format") != Value(format)) refuse(fmt::format("is not of format {}", format));
  if (taken("prior.model") != Value(std::string(model)))
    refuse(fmt::format("was learnt with another model than {}, which is that of this run", model));
  for (const FileValue& value : values) {
    if (!value.name.starts_with("control.")) refuse(fmt::format("holds {}, which no controller learns", value.name));
  }
  return values;
}

std::string prior_text(const nlohmann::ordered_json& learnt, std::string_view model) {
  std::string text = fmt::format(
      "# What the controller has learnt of the rig in its last braking. abs_hil --prior reads and renews it.\n"
      "prior.format = {}\nprior.model = {}\n",
      format, nlohmann::json(model).dump());
  for (const auto& [key, value] : learnt.items()) text += fmt::format("{} = {}\n", key, value.dump());
  return text;
}

}  // namespace abs_hil::config
