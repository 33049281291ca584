#include <random>
#include <variant>

#include "catch.hpp"
#include "driver/can/messages.hpp"
#include "driver/can/signal_codec.hpp"

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

TEST_CASE("Signals have the positions of DBC files, in both byte orders") {
  // The examples are worked by hand from the DBC rules.
  Frame frame{.length = 8};
  frame.data = {0x12, 0x34, 0x56, 0x78};
  CHECK(raw_value(frame, {"", 0, 16}) == 0x3412);
  CHECK(raw_value(frame, {"", 4, 8}) == 0x41);
  CHECK(raw_value(frame, {.name = "", .start_bit = 7, .bits = 16, .order = ByteOrder::big_endian}) == 0x1234);
  CHECK(raw_value(frame, {.name = "", .start_bit = 3, .bits = 8, .order = ByteOrder::big_endian}) == 0x23);
  frame.data[0] = 0x80;
  CHECK(raw_value(frame, {"", 7, 1, true}) == -1);
  CHECK(raw_value(frame, {"", 0, 8, true}) == -128);
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
        const std::int64_t least = nearest_raw(signal, signal.least);
        const std::int64_t most = nearest_raw(signal, signal.most);
        const auto span = static_cast<std::uint64_t>(most - least) + 1;
        const std::int64_t raw = least + static_cast<std::int64_t>(random() % span);
        set_raw_value(frame, signal, raw);
        REQUIRE(raw_value(frame, signal) == raw);
        REQUIRE(in_range(signal, raw));
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
  const Frame frame = command_frame(
      {.duties = {.brake = 7000, .drive = 10000}, .drive_enable = true, .heartbeat = 17, .sequence = 254});
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
  CHECK(sync_frame(9).length == 2);
  CHECK(sync_frame(9).data[0] == 9);
  CHECK(raw_value(time_frame(123'456'789'012), signal::host_time) == 123'456'789'012);
}

TEST_CASE("A node's frame is decoded completely or not at all") {
  Frame good = node_frame(id::encoders, 8);
  set_raw_value(good, signal::upper_counts, -5);
  set_raw_value(good, signal::lower_counts, 8'388'607);
  set_raw_value(good, signal::sequence_of_8, 200);
  good = checked(good);
  const Decoded decoded = decode(good);
  REQUIRE(decoded.error == DecodeError::none);
  const auto& encoders = std::get<EncodersMessage>(decoded.message);
  CHECK(encoders.upper_counts == -5);
  CHECK(encoders.lower_counts == 8'388'607);
  CHECK(encoders.sequence == 200);

  SECTION("wrong length") {
    good.length = 7;
    CHECK(decode(good).error == DecodeError::wrong_length);
    CHECK(std::holds_alternative<std::monostate>(decode(good).message));
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
  Frame status = node_frame(id::status, 8);
  set_raw_value(status, signal::supply, 24'000);
  set_raw_value(status, signal::temperature, -1234);
  CHECK(decode(checked(status)).error == DecodeError::none);
  const auto message = std::get<StatusMessage>(decode(checked(status)).message);
  CHECK_THAT(message.supply_V, Catch::Matchers::WithinAbs(24.0, 1e-12));
  CHECK_THAT(message.temperature_C, Catch::Matchers::WithinAbs(-12.34, 1e-12));

  set_raw_value(status, signal::supply, supply_unknown);
  set_raw_value(status, signal::temperature, temperature_unknown);
  const auto unknown = std::get<StatusMessage>(decode(checked(status)).message);
  CHECK(std::isnan(unknown.supply_V));
  CHECK(std::isnan(unknown.temperature_C));

  set_raw_value(status, signal::node_state, 3);
  CHECK(decode(checked(status)).error == DecodeError::out_of_range);
  Frame outputs = node_frame(id::outputs, 8);
  set_raw_value(outputs, signal::brake_applied, 10'001);
  CHECK(decode(checked(outputs)).error == DecodeError::out_of_range);
}

TEST_CASE("The FD measurement is only valid in FD frames") {
  Frame frame = checked(node_frame(id::measurement, 24));
  CHECK(decode(frame).error == DecodeError::none);
  frame.fd = false;
  CHECK(decode(frame).error == DecodeError::wrong_length);
}
