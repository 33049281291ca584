#include <fstream>
#include <sstream>

#include "catch.hpp"
#include "config/explain.hpp"

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
  CHECK(phase["required"] == nlohmann::ordered_json{"name", "until"});
  CHECK(schema["$defs"]["until"]["properties"]["any"]["items"]["$ref"] == "#/$defs/until");
}
