// The CAN protocol: places of signals, its check, and frames by hand.
#include <cmath>
#include <random>

#include "catch.hpp"
#include "driver/can/protocol.hpp"

using namespace abs_hil::driver::can;

namespace {

/// A node's frame with a right check.
Frame node_frame(std::uint32_t identifier, std::uint8_t bytes) {
  Frame frame{.id = identifier, .length = bytes, .fd = bytes > 8};
  return frame;
}

Frame checked(Frame frame) {
  frame.data[frame.length - 1U] = checksum(frame);
  return frame;
}

}  // namespace

TEST_CASE("Signals have the positions of DBC files") {
  // The examples are worked by hand from the DBC rules.
  Frame frame{.length = 8};
  frame.data = {0x12, 0x34, 0x56, 0x78};
  CHECK(raw_value(frame, {"", 0, 16, nullptr}) == 0x3412);
  CHECK(raw_value(frame, {"", 4, 8, nullptr}) == 0x41);
  frame.data[0] = 0x80;
  CHECK(raw_value(frame, {.name = "", .start_bit = 7, .bits = 1, .value = nullptr, .is_signed = true}) == -1);
  CHECK(raw_value(frame, {.name = "", .start_bit = 0, .bits = 8, .value = nullptr, .is_signed = true}) == -128);
}

TEST_CASE("Every signal of the protocol reads back what was written and changes no other bit") {
  std::mt19937_64 random(7);
  for (const Message& message : messages()) {
    for (const Signal& signal : message.signals) {
      for (int i = 0; i < 50; ++i) {
        Frame frame;
        for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
        const Frame before = frame;
        const std::int64_t old = raw_value(frame, signal);
        const std::int64_t least = least_raw(signal);
        const std::int64_t most = most_raw(signal);
        const auto span = static_cast<std::uint64_t>(most - least) + 1;
        const std::int64_t raw = least + static_cast<std::int64_t>(random() % span);
        set_raw_value(frame, signal, raw);
        REQUIRE(raw_value(frame, signal) == raw);
        set_raw_value(frame, signal, old);
        REQUIRE(frame.data == before.data);
      }
    }
  }
}

TEST_CASE("The check is CRC-8 SAE J1850") {
  // Known answer of that CRC: 0x4B for the text 123456789. Identifier bytes come first, so "12" is the identifier.
  Frame frame{.id = '1' | '2' << 8, .length = 8};
  frame.data = {'3', '4', '5', '6', '7', '8', '9', 0xAA};
  CHECK(checksum(frame) == 0x4B);
}

TEST_CASE("The host's frames have the contents of their messages") {
  const Frame frame = frame_of(
      id::command, {.brake_duty = 7000, .drive_duty = 10000, .drive_enable = 1, .heartbeat = 17, .sequence = 254});
  CHECK(frame.id == 0x081);
  REQUIRE(frame.length == 8);
  CHECK(frame.data[0] == (7000 & 0xFF));
  CHECK(frame.data[1] == 7000 >> 8);
  CHECK(frame.data[2] == (10000 & 0xFF));
  CHECK(frame.data[3] == 10000 >> 8);
  CHECK(frame.data[4] == 1);
  CHECK(frame.data[5] == 17);
  CHECK(frame.data[6] == 254);
  CHECK(frame.data[7] == checksum(frame));
  const Frame sync = frame_of(id::sync, {.sequence = 9});
  CHECK(sync.length == 2);
  CHECK(sync.data[0] == 9);
  const Frame time = frame_of(id::time, {.host_time_ns = 0x1CBE991A14});
  CHECK(time.length == 8);
  for (std::size_t i = 0; i < 6; ++i) CHECK(time.data[i] == (0x1CBE991A14U >> 8U * i & 0xFFU));
}

TEST_CASE("A node's frame is decoded completely or not at all") {
  Frame good = frame_of(id::encoders, {.upper_counts = -5, .lower_counts = 8'388'607, .sequence = 200});
  CHECK(good.data[0] == 0xFB);  // 24 bits of two's complement
  CHECK(good.data[2] == 0xFF);
  CHECK(good.data[5] == 0x7F);
  CHECK(good.data[6] == 200);
  const Decoded decoded = decode(good);
  REQUIRE(decoded.error == DecodeError::none);
  CHECK(decoded.id == id::encoders);
  CHECK(decoded.values.upper_counts == -5);
  CHECK(decoded.values.lower_counts == 8'388'607);
  CHECK(decoded.values.sequence == 200);

  SECTION("wrong length") {
    good.length = 7;
    CHECK(decode(good).error == DecodeError::wrong_length);
    CHECK(decode(good).id == 0);
    CHECK(decode(good).values.upper_counts == 0);
    good.length = 0;
    CHECK(decode(good).error == DecodeError::wrong_length);
  }
  SECTION("any one bit turned over") {
    for (unsigned bit = 0; bit < 64; ++bit) {
      Frame bad = good;
      bad.data[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
      CHECK(decode(bad).error == DecodeError::wrong_check);
    }
  }
  SECTION("the same bytes under another identifier") {
    good.id = id::latch;
    CHECK(decode(good).error == DecodeError::wrong_check);
  }
  SECTION("identifiers that are not the node's") {
    good.id = id::command;
    CHECK(decode(good).error == DecodeError::unknown_identifier);
    good.id = 0x123;
    CHECK(decode(good).error == DecodeError::unknown_identifier);
  }
  SECTION("error frames") {
    good.error = true;
    CHECK(decode(good).error == DecodeError::unknown_identifier);
  }
}

TEST_CASE("Values outside their range are refused; unknown values are NaN") {
  const auto decoded = [](std::uint32_t identifier, const Values& values) {
    return decode(frame_of(identifier, values));
  };
  const Decoded known = decoded(id::status, {.supply = 24'000, .temperature = -1234});
  CHECK(known.error == DecodeError::none);
  CHECK_THAT(known.values.supply_V(), Catch::Matchers::WithinAbs(24.0, 1e-12));
  CHECK_THAT(known.values.temperature_C(), Catch::Matchers::WithinAbs(-12.34, 1e-12));

  const Decoded unknown = decoded(id::status, {.supply = supply_unknown, .temperature = temperature_unknown});
  CHECK(unknown.error == DecodeError::none);
  CHECK(std::isnan(unknown.values.supply_V()));
  CHECK(std::isnan(unknown.values.temperature_C()));

  CHECK(decoded(id::status, {.node_state = 3}).error == DecodeError::out_of_range);
  CHECK(decoded(id::outputs, {.brake_duty = 10'000}).error == DecodeError::none);
  CHECK(decoded(id::outputs, {.brake_duty = 10'001}).error == DecodeError::out_of_range);
}

TEST_CASE("The FD measurement is only valid in FD frames") {
  Frame frame = checked(node_frame(id::measurement, 24));
  CHECK(decode(frame).error == DecodeError::none);
  frame.fd = false;
  CHECK(decode(frame).error == DecodeError::wrong_length);
}
