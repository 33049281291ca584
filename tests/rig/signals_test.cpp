// Names of a controller's own signals.
#include "abs_hil/rig/signals.hpp"

#include <array>
#include <stdexcept>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

std::vector<std::string> names_of(std::initializer_list<std::string_view> names) {
  std::vector<rig::Signal> signals;
  for (const std::string_view name : names) signals.push_back({name, "for the test"});
  return rig::signal_names(signals);
}

}  // namespace

TEST_CASE("the names of signals come in order") {
  CHECK(names_of({"I_m", "zeta_N", "V"}) == std::vector<std::string>{"I_m", "zeta_N", "V"});
  CHECK(names_of({}).empty());
}

TEST_CASE("a name that would not do as a column is refused, and the message says which") {
  for (const std::string_view bad :
       {"", "1st", "with space", "a,b", "h\xc3\xb6he", "a-b", "a_name_of_more_than_thirty_two_characters"}) {
    CHECK_THROWS_WITH(names_of({"V", bad}), Contains("'" + std::string(bad) + "'") && Contains("letters, digits"));
    CHECK_FALSE(rig::is_signal_name(bad));
  }
  CHECK_THROWS_WITH(names_of({"V", "V"}), Contains("'V' occurs twice"));
  CHECK_THROWS_WITH(names_of({"theta_est_N"}), Contains("name of a quantity of every run"));
  CHECK(rig::is_signal_name("a_name_of_exactly_32_characters_"));
  CHECK_FALSE(rig::is_signal_name("a_name_of_exactly_33_characters__"));
  CHECK_FALSE(rig::is_signal_name("theta_est_N"));
}

TEST_CASE("at most eight signals are taken") {
  CHECK(names_of({"a", "b", "c", "d", "e", "f", "g", "h"}).size() == rig::signal_max);
  CHECK_THROWS_WITH(names_of({"a", "b", "c", "d", "e", "f", "g", "h", "i"}), Contains("9 signals; give at most 8"));
}
