#include "guardian/launch_config.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace abs_hil::guardian {

std::string to_json(const LaunchConfig& brief) {
  return nlohmann::json{{"config_json", brief.config_json}, {"experiment", brief.experiment},
                        {"controller", brief.controller},   {"plant", brief.plant},
                        {"backend", brief.backend},         {"version", brief.version},
                        {"realtime", brief.realtime},       {"record_prefix", brief.record_prefix}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

LaunchConfig parse_launch_config(const std::string& json) try {
  const nlohmann::json object = nlohmann::json::parse(json);
  return {.config_json = object.at("config_json"),
          .experiment = object.at("experiment"),
          .controller = object.at("controller"),
          .plant = object.at("plant"),
          .backend = object.at("backend"),
          .version = object.at("version"),
          .realtime = object.at("realtime"),
          .record_prefix = object.at("record_prefix")};
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(std::string("guardian: not a brief: ") + error.what());
}

}  // namespace abs_hil::guardian
