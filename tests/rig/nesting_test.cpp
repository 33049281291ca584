// Texts in JSON and TOML are parsed up to the limit of their nesting, and refused beyond it.
#include "rig/nesting.hpp"

#include <string>

#include "catch.hpp"
#include "rig/parse_json.hpp"
#include "rig/parse_toml.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

std::string times(int count, const std::string& text) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

}  // namespace

TEST_CASE("JSON is parsed up to the limit of its nesting, and refused beyond it before a value is made") {
  const auto nested = [](int levels) { return times(levels, R"({"a":)") + "1" + times(levels, "}"); };
  CHECK_NOTHROW(rig::parse_json(nested(rig::nesting_max)));
  CHECK_THROWS_WITH(rig::parse_json(nested(rig::nesting_max + 1)), Contains("nested deeper than 64 levels"));
  for (const std::string bracket : {"[", "{\"a\":", "[{\"a\":"}) {
    CHECK_THROWS_AS(rig::parse_json(times(1'000'000, bracket)), nlohmann::json::parse_error);
    CHECK(rig::parse_json_if_valid(times(1'000'000, bracket)).is_discarded());
  }
  // Brackets in texts do not nest, and values side by side do not either.
  CHECK(rig::parse_json("[\"" + times(1000, R"([{\"\\)") + "\"]").size() == 1);
  CHECK(rig::parse_json("[" + times(1000, "[],") + "1]").size() == 1001);
  CHECK(rig::parse_json_if_valid("{").is_discarded());
}

TEST_CASE("TOML is parsed up to the limits of its nesting and of its names, and refused beyond them") {
  const auto parse = [](const std::string& text) { return rig::parse_toml(text, "file.toml"); };
  const auto name = [](int parts) { return times(parts - 1, "a.") + "a"; };
  const auto array = [](int levels) { return "x = " + times(levels, "[") + times(levels, "]") + "\n"; };
  CHECK_NOTHROW(parse("[" + name(rig::name_parts_max) + "]\n" + name(rig::name_parts_max) + " = 1\n"));
  CHECK_NOTHROW(parse(array(rig::nesting_max)));
  CHECK_NOTHROW(parse("x = [" + times(1000, "0.5, ") + "1.5]\ny = '" + times(1000, "a.[") + "'\n# " + times(99, "[.")));
  CHECK_NOTHROW(parse("x = \"\"\"" + times(1000, "a.\n[\"") + "\"\"\"\n"));
  for (const int parts : {rig::name_parts_max + 1, 50'000}) {
    CHECK_THROWS_WITH(parse("[" + name(parts) + "]\n"), Contains("more than 16 parts"));
    CHECK_THROWS_WITH(parse(name(parts) + " = 1\n"), Contains("more than 16 parts"));
    CHECK_THROWS_WITH(parse("x = {" + name(parts) + " = 1}\n"), Contains("more than 16 parts"));
    CHECK_THROWS_WITH(parse("[" + times(parts - 1, "\"a\" . ") + "a]\n"), Contains("more than 16 parts"));
  }
  CHECK_THROWS_WITH(parse(array(rig::nesting_max + 1)), Contains("deeper than 64 levels"));
  CHECK_THROWS_WITH(parse("x = " + times(1'000'000, "{a=[")), Contains("deeper than 64 levels"));
  try {
    static_cast<void>(parse("a = 1\n" + name(99) + " = 1\n"));
  } catch (const toml::parse_error& error) {
    CHECK(error.source().begin.line == 2);
    CHECK(*error.source().path == "file.toml");
  }
}
