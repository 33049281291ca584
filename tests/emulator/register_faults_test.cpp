// Faults of the emulated card's registers: each does what its name says.
#include <set>
#include <stdexcept>

#include "catch.hpp"
#include "emulator/card_model.hpp"

using namespace abs_hil::emulator;

namespace {
constexpr std::uint32_t plain = 0x90;  // keeps what is written
}

TEST_CASE("Each fault does what its name says, and ok heals it") {
  CardModel model({});
  FaultyCard card(model, 1);
  static_cast<void>(card.write32(plain, 10));

  card.set("90:stuck");
  static_cast<void>(card.write32(plain, 11));
  CHECK(card.read32(plain).value == 10);
  card.set("0x90:ok");
  CHECK(card.read32(plain).value == 10);  // the write was lost

  card.set("90:wrong=-3");
  CHECK(card.read32(plain).value == 7);

  card.set("90:slow=250");
  CHECK(card.read32(plain).delay_ns == 250'000);
  CHECK(card.write32(plain, 12).delay_ns == 250'000);
  CHECK(card.read32(plain).value == 12);

  card.set("90:off");
  CHECK(card.read32(plain).failed);
  CHECK(card.write32(plain, 13).failed);
  CHECK_FALSE(card.read32(0x94).failed);  // the others still work

  card.set("90:ok");
  CHECK(card.read32(plain).value == 12);
}

TEST_CASE("Delayed shows the value of n reads ago") {
  CardModel model({});
  FaultyCard card(model, 1);
  card.set("90:delayed=2");
  std::vector<std::uint32_t> seen;
  for (std::uint32_t i = 1; i <= 5; ++i) {
    model.write32(plain, i);
    seen.push_back(card.read32(plain).value);
  }
  CHECK(seen == std::vector<std::uint32_t>{1, 1, 1, 2, 3});
}

TEST_CASE("Intermittent fails with its probability, garbage is random; both repeat with their seed") {
  CardModel model({});
  std::set<std::uint32_t> values;
  int failures = 0;
  std::vector<std::uint32_t> first;
  for (int run = 0; run < 2; ++run) {
    FaultyCard card(model, 7);
    card.set("90:garbage");
    card.set("94:intermittent=0.25");
    for (int i = 0; i < 1000; ++i) {
      const std::uint32_t value = card.read32(plain).value;
      values.insert(value);
      if (run == 0) first.push_back(value);
      if (run == 1) CHECK(value == first[static_cast<std::size_t>(i)]);
      failures += card.read32(0x94).failed ? 1 : 0;
    }
  }
  CHECK(values.size() > 990);
  CHECK(failures > 400);  // 500 expected, standard deviation 19
  CHECK(failures < 600);
}

TEST_CASE("All ones: the card neither answers nor takes writes") {
  CardModel model({});
  FaultyCard card(model, 1);
  card.answer_all_ones(true);
  static_cast<void>(card.write32(plain, 5));
  CHECK(card.read32(plain).value == 0xFFFF'FFFF);
  card.answer_all_ones(false);
  CHECK(card.read32(plain).value == 0);
}

TEST_CASE("Faults that cannot be understood are refused") {
  CardModel model({});
  FaultyCard card(model, 1);
  for (const char* text : {"", "90", "90:", "90:broken", "91:stuck", "100:stuck", "zz:stuck", "90:slow", "90:slow=x",
                           "90:intermittent=2", "90:stuck=1", "90:delayed=0"}) {
    INFO(text);
    CHECK_THROWS_AS(card.set(text), std::invalid_argument);
  }
}
