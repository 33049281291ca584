#include "guardian/launch_config.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "rig/parse_json.hpp"

namespace abs_hil::guardian {

std::string to_json(const LaunchConfig& config) {
  return nlohmann::json{{"config_json", config.config_json}, {"experiment", config.experiment},
                        {"controller", config.controller},   {"plant", config.plant},
                        {"backend", config.backend},         {"version", config.version},
                        {"realtime", config.realtime},       {"record_prefix", config.record_prefix},
                        {"signals", config.signals}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

LaunchConfig parse_launch_config(const std::string& json) try {
  const nlohmann::json object = rig::parse_json(json);
  return {.config_json = object.at("config_json"),
          .experiment = object.at("experiment"),
          .controller = object.at("controller"),
          .plant = object.at("plant"),
          .backend = object.at("backend"),
          .version = object.at("version"),
          .signals = object.at("signals"),
          .realtime = object.at("realtime"),
          .record_prefix = object.at("record_prefix")};
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(std::string("guardian: not a launch configuration: ") + error.what());
}

}  // namespace abs_hil::guardian
