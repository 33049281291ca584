// The card's registers and their conversions, by figures worked by hand.
#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "catch.hpp"
#include "driver/pci/wire.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::pci;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("The table lists each register once, in order, inside the window, with a meaning or what is open") {
  std::set<std::string> names;
  std::uint32_t last = 0;
  for (const Register& entry : registers()) {
    INFO(entry.name);
    CHECK(entry.offset % 4 == 0);
    CHECK(entry.offset < window_bytes);
    CHECK((entry.offset > last || entry.offset == 0));
    CHECK(names.insert(std::string(entry.name)).second);
    CHECK_FALSE((entry.meaning.empty() && entry.open.empty()));
    last = entry.offset;
  }
}

TEST_CASE("PWM frequencies are those of the vendor's demos and manual") {
  CHECK_THAT(pwm_frequency_Hz(PwmMode::bits_12, 60), WithinAbs(160.0, 0.5));
  CHECK_THAT(pwm_frequency_Hz(PwmMode::bits_8, 44), WithinAbs(3486.0, 1.0));
  CHECK_THAT(pwm_frequency_Hz(PwmMode::bits_8, 0), WithinRel(40e6 / 255.0, 1e-12));
}

TEST_CASE("Widths round to the nearest step and never exceed the cap") {
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 0.0, 1.0) == 0);
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 1.0, 1.0) == 4095);
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_8), 1.0, 1.0) == 255);
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 0.5 / 4095.0 - 1e-9, 1.0) == 0);
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 0.5 / 4095.0 + 1e-9, 1.0) == 1);
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 1.0, 0.7) ==
        2866);  // 0.7 * 4095 = 2866.5: rounding up would exceed it
  CHECK(abs_hil::rig::width_for(full_width(PwmMode::bits_12), 0.3, 0.7) == 1229);
  for (std::uint32_t width = 0; width <= 4095; ++width) {
    const double duty = static_cast<double>(width) / 4095.0;
    REQUIRE(abs_hil::rig::width_for(full_width(PwmMode::bits_12), duty, duty) ==
            width);  // a cap that is a width allows that width
  }
}

TEST_CASE("Conversions against figures worked by hand") {
  CHECK(supply_V(0) == 0.0);
  CHECK_THAT(supply_V(4600), WithinRel(20.0, 1e-12));
  CHECK_THAT(temperature_C(50'000, 100'000), WithinRel(35.0, 1e-12));
  CHECK(std::isnan(temperature_C(5, 0)));
  // 1700 rpm and a period of 10 ms: 1700 / 60 * 1024 * 0.01 = 290.13 lines.
  CHECK_THAT(velocity_rad_s(290, 400'000), WithinAbs(1700.0 * 2.0 * std::numbers::pi / 60.0, 0.1));
  CHECK(velocity_rad_s(0xABCD'0122, 400'000) == velocity_rad_s(0x0122, 400'000));  // low 16 bits alone
  CHECK(std::isnan(velocity_rad_s(1, 0)));
}
