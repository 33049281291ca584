// The JSON schema of experiments: it is the parser's own, and knows every key.
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "catch.hpp"
#include "config/script.hpp"

using namespace abs_hil;

TEST_CASE("config/experiments/schema.json equals the parser's schema") {
  std::ifstream file(ABS_HIL_EXPERIMENTS "/schema.json");
  std::stringstream text;
  text << file.rdbuf();
  INFO("renew it: abs_hil validate --schema > config/experiments/schema.json");
  CHECK(text.str() == config::schema().dump(2) + '\n');
}

TEST_CASE("the schema knows every key of every table with its unit, and refuses others") {
  const nlohmann::ordered_json schema = config::schema();
  const auto& phase = schema["$defs"]["phase"];
  CHECK(phase["properties"].contains("at_most_s"));
  CHECK(phase["properties"].contains("at_most"));
  CHECK(phase["additionalProperties"] == false);
  CHECK(phase["required"] == nlohmann::ordered_json::array({"name"}));
  CHECK(schema["$defs"]["until"]["properties"]["any"]["items"]["$ref"] == "#/$defs/until");
}

TEST_CASE("the schema knows the configuration keys that a script may set, with their ranges") {
  const auto settings = config::schema()["properties"]["settings"]["properties"];
  const auto& control = settings["control"]["properties"];
  CHECK(control["slip_ref"]["exclusiveMinimum"] == 0);
  CHECK(control["slip_ref"]["exclusiveMaximum"] == 1);
  CHECK(control["adaptive"]["properties"]["gamma"]["maximum"] == 1e4);
  CHECK(control["controller"]["anyOf"][0]["enum"][0] == "adaptive");
  CHECK(control["controller"]["anyOf"][1]["pattern"] == ".\\.so$|.\\.fmu$|.\\.agent$|^[A-Za-z0-9_.]+:[A-Za-z0-9_]+$");
  CHECK(settings["plant"]["properties"]["ideal_actuator"]["type"] == "boolean");
  for (const char* foreign : {"driver", "realtime", "guardian", "commands"}) CHECK_FALSE(settings.contains(foreign));
  CHECK_FALSE(settings["experiment"]["properties"].contains("name"));
}
