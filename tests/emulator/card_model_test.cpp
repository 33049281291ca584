// The emulated card against the register facts, worked by hand.

#include "emulator/card_model.hpp"

#include <bit>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "catch.hpp"

using namespace abs_hil::emulator;
using Catch::Matchers::WithinAbs;

namespace {

constexpr std::int64_t ms = 1'000'000;

void set_width(CardModel& card, std::uint32_t index, std::uint32_t width) {
  card.write32(0x60, index);
  card.write32(0x6C, width);
}

std::int32_t counter(CardModel& card, std::uint32_t index) {
  card.write32(0x80, index);
  return std::bit_cast<std::int32_t>(card.read32(0x88));
}

}  // namespace

TEST_CASE("PWM registers belong to the indexed channel and read back") {
  CardModel card({});
  card.write32(0x60, 0);
  CHECK(card.read32(0x68) == 60);
  CHECK(card.read32(0x64) == 1);
  set_width(card, 0, 1000);
  set_width(card, 1, 2000);
  CHECK(card.read32(0x6C) == 2000);
  card.write32(0x60, 0);
  CHECK(card.read32(0x6C) == 1000);
  CHECK(card.outputs().drive_duty == 1000.0 / 4095.0);
  CHECK(card.outputs().brake_duty == 2000.0 / 4095.0);
  card.write32(0x64, 0);
  card.write32(0x6C, 51);
  CHECK(card.outputs().drive_duty == 0.2);
  set_width(card, 5, 77);  // no such channel
  CHECK(card.outputs().brake_duty == 2000.0 / 4095.0);
}

TEST_CASE("Since when both widths are 0, and when either was last written") {
  CardModel card({});
  CHECK(card.pwm_widths().zero_since_ns == 0);
  card.advance_to(1 * ms);
  set_width(card, 0, 1000);
  card.advance_to(2 * ms);
  set_width(card, 1, 2000);
  CHECK(card.pwm_widths().drive == 1000);
  CHECK(card.pwm_widths().brake == 2000);
  card.advance_to(3 * ms);
  set_width(card, 0, 0);
  CHECK(card.pwm_widths().brake == 2000);
  card.advance_to(4 * ms);
  set_width(card, 1, 0);
  card.advance_to(5 * ms);
  CHECK(card.pwm_widths().zero_since_ns == 4 * ms);
  CHECK(card.pwm_widths().last_written_ns == 4 * ms);
  set_width(card, 0, 0);
  CHECK(card.pwm_widths().zero_since_ns == 4 * ms);
  CHECK(card.pwm_widths().last_written_ns == 5 * ms);
}

TEST_CASE("A trip that clears the widths does not count as a write of the host") {
  CardModel card({.start_speed_rad_s = 50.0, .trip_clears_width = true});
  card.advance_to(1 * ms);
  set_width(card, 0, 1000);
  card.advance_to(2 * ms);
  card.trip_overspeed();
  CHECK(card.pwm_widths().drive == 0);
  CHECK(card.pwm_widths().zero_since_ns == 2 * ms);
  CHECK(card.pwm_widths().last_written_ns == 1 * ms);
}

TEST_CASE("Counters are held at 0 as long as their bit of the mask is set, each by itself") {
  CardModel card({.start_speed_rad_s = 10.0});
  card.advance_to(100 * ms);
  const double counts = 1.0 / (2.0 * std::numbers::pi) * 4096.0;  // 10 rad/s for 0.1 s
  CHECK_THAT(counter(card, 0), WithinAbs(counts, 0.1 * counts));
  CHECK_THAT(counter(card, 1), WithinAbs(counts, 0.1 * counts));
  CHECK(counter(card, 2) == 0);
  card.write32(0x84, 2);  // the upper wheel's
  CHECK(counter(card, 1) == 0);
  CHECK(counter(card, 0) > 100);
  card.advance_to(150 * ms);
  CHECK(counter(card, 1) == 0);
  card.write32(0x84, 0);
  CHECK(counter(card, 1) == 0);
  card.advance_to(160 * ms);
  CHECK(counter(card, 1) > 20);
  CHECK(counter(card, 0) > counter(card, 1) + 200);
}

TEST_CASE("Overspeed latches until the wheels stand, and takes drive and brake off") {
  CardModel card({.start_speed_rad_s = 20.0, .overspeed_rpm = 100.0});  // 20 rad/s is 191 rpm
  set_width(card, 0, 1000);
  set_width(card, 1, 1000);
  CHECK(card.outputs().drive_duty > 0.0);
  card.advance_to(1 * ms);
  CHECK(card.trip_flags() == 1);
  CHECK(card.read32(0xAC) == 1);
  CHECK(card.outputs().drive_duty == 0.0);
  CHECK(card.outputs().brake_duty == 0.0);
  bool released = false;
  for (std::int64_t t = 2; t < 60'000 && !released; ++t) {
    card.advance_to(t * ms);
    released = card.trip_flags() == 0;
    const double fastest = std::max(card.plant().state().omega1_rad_s, card.plant().state().omega2_rad_s);
    if (fastest > 1.0) CHECK_FALSE(released);
  }
  CHECK(released);
  CHECK(card.outputs().drive_duty == 1000.0 / 4095.0);  // the registers kept their widths
}

TEST_CASE("Supply and temperature trip while they last; the order of bits 0 and 2 can be either") {
  for (const std::uint32_t overspeed_bit : {0U, 2U}) {
    CardModel card({.overspeed_bit = overspeed_bit});
    set_width(card, 1, 1000);
    CHECK(card.read32(0xAC) == 0);
    card.set_supply_V(14.0);
    CHECK(card.read32(0xAC) == 2);
    CHECK(card.outputs().brake_duty == 0.0);
    card.set_supply_V(0.0);
    CHECK(card.read32(0x38) == 0);
    CHECK(card.read32(0xAC) == 2);
    card.set_supply_V(20.0);
    CHECK(card.read32(0x38) == 4600);
    CHECK(card.read32(0xAC) == 0);
    CHECK(card.outputs().brake_duty > 0.0);
    card.set_temperature_C(91.0);
    CHECK(card.read32(0xAC) == 1U << (2U - overspeed_bit));
    CHECK_THAT(235.0 - 400.0 * card.read32(0xB4) / card.read32(0xB8), WithinAbs(91.0, 0.01));
    card.trip_overspeed();
  }
  CHECK_THROWS_AS(CardModel({.overspeed_bit = 1}), std::invalid_argument);
}

TEST_CASE("The E-stop cuts the drive only; without a host the PWMs hold") {
  CardModel card({});
  set_width(card, 0, 4095);
  set_width(card, 1, 2000);
  card.press_emergency_stop(true);
  CHECK(card.outputs().drive_duty == 0.0);
  CHECK(card.outputs().brake_duty > 0.0);
  card.press_emergency_stop(false);
  set_width(card, 1, 0);
  card.advance_to(2000 * ms);
  CHECK(card.outputs().drive_duty == 1.0);
  CHECK(card.plant().state().omega2_rad_s > 30.0);
}

TEST_CASE("Velocity registers show lines in the velocity period") {
  CardModel card({.start_speed_rad_s = 178.0});
  // 178 rad/s, 10 ms, 1024 lines: 290 lines.
  CHECK_THAT(card.read32(0x54), WithinAbs(290.0, 1.0));
  CHECK_THAT(card.read32(0x58), WithinAbs(290.0, 1.0));
  CHECK(card.read32(0x50) == 400'000);
}

TEST_CASE("The times of the host's accesses affect only when inputs change") {
  CardModel often({.start_speed_rad_s = 100.0});
  CardModel rarely({.start_speed_rad_s = 100.0});
  for (CardModel* card : {&often, &rarely}) set_width(*card, 1, 2400);
  for (std::int64_t t = 0; t <= 100'000'000; t += 37'000) often.advance_to(t);
  often.advance_to(100 * ms);
  rarely.advance_to(100 * ms);
  CHECK_THAT(often.plant().state().omega1_rad_s, WithinAbs(rarely.plant().state().omega1_rad_s, 1e-6));
  CHECK(often.time_ns() == rarely.time_ns());
}

TEST_CASE("Undocumented registers read 0 and ignore writes; read-only ones keep their value") {
  CardModel card({});
  for (const std::uint32_t offset : {0x0CU, 0x3CU, 0x70U, 0xC0U, 0xFCU}) {
    card.write32(offset, 0x1234);
    CHECK(card.read32(offset) == 0);
  }
  card.write32(0x00, 0x1234);
  CHECK(card.read32(0x00) == 0xAB5);
}
