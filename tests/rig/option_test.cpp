// Rows of options: visiting, ranges, names.
#include "abs_hil/rig/option.hpp"

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "abs_hil/rig/option_check.hpp"
#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

namespace {

struct LampOptions {
  ABS_HIL_OPTIONS(LampOptions);
  ABS_HIL_OPTION(double, flux_lm, 800.0, .unit = "lm", .meaning = "light of the lamp", .range = rig::positive(1e4),
                 .search = rig::search(10, 1000));
  ABS_HIL_OPTION(std::string, colour, "white", .meaning = "its colour", .allowed = {"white", "red"});
};

std::string_view room_name(std::size_t index) noexcept { return index == 0 ? "hall" : ""; }

struct HouseOptions {
  ABS_HIL_OPTIONS(HouseOptions);
  ABS_HIL_OPTION(std::int32_t, floors, 2, .meaning = "its floors", .range = rig::between(1, 9));
  int not_an_option{7};
  ABS_HIL_GROUP(LampOptions, lamp, "lamp.", {.flux_lm = 400.0});
  ABS_HIL_GROUP(LampOptions, torch, rig::not_searched("torch_"), {});
  ABS_HIL_OPTION(bool, lit, true, .key = "is_lit", .meaning = "whether its lamps are on");
  ABS_HIL_OPTION(std::string, room, "hall", .meaning = "where they are", .allowed = room_name);
};
static_assert(std::is_aggregate_v<HouseOptions>);

}  // namespace

TEST_CASE("Rows are visited in their order, groups with their prefix, and hold the members' own values") {
  HouseOptions house{.floors = 3, .torch = {.colour = "red"}};
  std::vector<std::string> names, searched;
  rig::for_each_option(house, "house.", [&](const std::string& name, const rig::OptionFacts& facts, auto& value) {
    names.push_back(name);
    if (facts.search.given()) searched.push_back(name);
    if constexpr (std::is_same_v<std::remove_reference_t<decltype(value)>, double>) value += 1.0;
  });
  CHECK(names == std::vector<std::string>{"house.floors", "house.lamp.flux_lm", "house.lamp.colour",
                                          "house.torch_flux_lm", "house.torch_colour", "house.is_lit", "house.room"});
  CHECK(searched == std::vector<std::string>{"house.lamp.flux_lm"});
  CHECK(house.lamp.flux_lm == 401.0);
  CHECK(house.torch.flux_lm == 801.0);
  CHECK(house.torch.colour == "red");
  CHECK(house.floors == 3);
}

TEST_CASE("Values that their row does not allow are refused by name, those of groups too") {
  CHECK_NOTHROW(rig::require_valid(HouseOptions{}, "house."));
  CHECK_THROWS_WITH(rig::require_valid(HouseOptions{.floors = 10}, "house."),
                    Contains("house.floors = 10 is not valid; give a number in [1, 9] (its floors)"));
  CHECK_THROWS_WITH(rig::require_valid(HouseOptions{.lamp = {.flux_lm = 0.0}}, "house."),
                    Contains("house.lamp.flux_lm = 0 is not valid; give a number in (0, 10000] lm"));
  CHECK_THROWS_WITH(rig::require_valid(HouseOptions{.torch = {.colour = "blue"}}, "house."),
                    Contains("house.torch_colour = \"blue\" is not valid; give one of white, red"));
  CHECK_THROWS_AS(rig::require_valid(HouseOptions{.room = "attic"}, ""), std::invalid_argument);
  const LampOptions unknown{.flux_lm = std::numeric_limits<double>::quiet_NaN()};
  CHECK_THROWS_AS(rig::require_valid(unknown, &LampOptions::flux_lm, "lamp."), std::invalid_argument);
  CHECK_NOTHROW(rig::require_valid(LampOptions{.colour = "blue"}, &LampOptions::flux_lm, "lamp."));
}

TEST_CASE("Ends of ranges belong to them unless open") {
  CHECK_FALSE(rig::positive(1).contains(0.0));
  CHECK(rig::positive(1).contains(1.0));
  CHECK_FALSE(rig::positive(1).contains(std::numeric_limits<double>::quiet_NaN()));
  CHECK(rig::positive(1).text() == "(0, 1]");
  CHECK(rig::negative(-500).text() == "[-500, 0)");
  CHECK_FALSE(rig::from_zero_below(1).contains(1.0));
  CHECK(rig::from_zero_below(1).contains(0.0));
  CHECK_FALSE(rig::open_between(0, 1).contains(0.0));
  CHECK(rig::between(4, 1e6).text() == "[4, 1000000]");
}
