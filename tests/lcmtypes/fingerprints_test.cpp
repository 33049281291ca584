#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "abs_hil/command_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "catch.hpp"

namespace {

/// Type -> fingerprint of lcmtypes/fingerprints.txt.
std::map<std::string, std::uint64_t> published() {
  std::map<std::string, std::uint64_t> table;
  std::ifstream file(ABS_HIL_FINGERPRINTS);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream words(line);
    std::string type;
    words >> type >> std::hex >> table[type];
  }
  return table;
}

template <class Message>
std::uint64_t fingerprint() {
  return static_cast<std::uint64_t>(Message::getHash());
}

}  // namespace

TEST_CASE("the C++ types have the published fingerprints") {
  const auto table = published();
  REQUIRE(table.size() >= 5);
  INFO("a published type must not change: see lcmtypes/README.md");
  CHECK(table.at("command_t") == fingerprint<abs_hil::command_t>());
  CHECK(table.at("event_t") == fingerprint<abs_hil::event_t>());
  CHECK(table.at("experiment_t") == fingerprint<abs_hil::experiment_t>());
  CHECK(table.at("status_t") == fingerprint<abs_hil::status_t>());
  CHECK(table.at("telemetry_t") == fingerprint<abs_hil::telemetry_t>());
}
