// The LCM types have their published fingerprints.
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "abs_hil/message_fields.hpp"
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

}  // namespace

TEST_CASE("the C++ types have the published fingerprints") {
  const auto table = published();
  REQUIRE(table.size() >= 5);
  INFO("lcmtypes/README.md says how types change");
  abs_hil::telemetry::for_each_message_type([&]<class Message>() {
    CAPTURE(abs_hil::telemetry::type_name<Message>);
    REQUIRE(table.contains(std::string(abs_hil::telemetry::type_name<Message>)));
    CHECK(table.at(std::string(abs_hil::telemetry::type_name<Message>)) ==
          static_cast<std::uint64_t>(Message::getHash()));
  });
}
