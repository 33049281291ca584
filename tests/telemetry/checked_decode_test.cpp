// Decoding LCM messages that are whole, cut or wrong.

#include <random>

#include "catch.hpp"
#include "telemetry/message_capture.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::telemetry {
namespace {

/// Gives every field a value of its own.
struct FillDistinct {
  std::mt19937_64 generator{7};
  template <class Number>
    requires std::is_arithmetic_v<Number>
  void operator()(std::string_view, Number& value) {
    value = static_cast<Number>(generator() >> 40U);
  }
  void operator()(std::string_view name, std::int32_t& value) {
    value = name == "value_count" ? 3 : static_cast<std::int32_t>(generator() >> 40U);
  }
  void operator()(std::string_view, std::string& value) { value = std::to_string(generator()); }
  void operator()(std::string_view, std::vector<double>& values) { values = {0.5, -0.0, 1e300}; }
};

template <class Message>
test::Bytes bytes_of(const Message& message) {
  EncodeBuffer buffer;
  const auto bytes = buffer.encode(message);
  return {bytes.begin(), bytes.end()};
}

template <class Message>
Message distinct() {
  Message message{};
  FillDistinct fill;
  visit_fields(message, fill);
  return message;
}

TEST_CASE("the field lists are the generated encoders': every field, in order") {
  for_each_message_type([]<class Message>() {
    INFO(type_name<Message>);
    const test::Bytes bytes = bytes_of(distinct<Message>());
    Message ours{};
    REQUIRE(decode_checked(bytes, ours).empty());
    CHECK(bytes_of(ours) == bytes);
    // A list that lacks a field would leave the generated decoder's value different from ours.
    CHECK(bytes_of(test::decoded<Message>(bytes)) == bytes);
    Message shorter{};
    CHECK_FALSE(decode_checked(std::span(bytes).first(bytes.size() - 1), shorter).empty());
  });
}

TEST_CASE("packets cut short anywhere, too long or of another type are refused, whatever the type") {
  for_each_message_type([]<class Message>() {
    INFO(type_name<Message>);
    test::Bytes bytes = bytes_of(distinct<Message>());
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      Message message{};
      CHECK_FALSE(decode_checked(std::span(bytes).first(size), message).empty());
    }
    Message message{};
    bytes.push_back(0);
    CHECK(decode_checked(bytes, message) == "longer than its type");
    bytes.pop_back();
    bytes[3] = static_cast<std::uint8_t>(bytes[3] ^ 1U);
    CHECK(decode_checked(bytes, message).starts_with("wrong fingerprint"));
  });
}

TEST_CASE("a record survives the way through a message") {
  telemetry_t message = to_message({}, 0.0, 0, {.signals = {"a", "b"}});
  FillDistinct fill;
  visit_fields(message, [&fill](std::string_view name, auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_arithmetic_v<Value>) {
      if (name != "value_count") fill(name, value);
    }
  });
  message.values = {250.0, -1.0, 0.5, -0.0};
  message.sample_valid = message.wheels_apart = 1;
  message.phase_index = 7;
  message.phase = telemetry_t::PHASE_HOLD;
  message.motor_enable = 1;
  message.overrun_cause = 3;
  message.trip_flags = 5;
  message.periods_skipped = 4;
  const telemetry_t back =
      to_message(to_record(message), message.distance_m, message.sequence, {.signals = {"a", "b"}});
  CHECK(bytes_of(back) == bytes_of(message));
}

TEST_CASE("an array whose length lies is refused") {
  telemetry_t message = to_message({}, 0.0, 0, {.signals = {"a", "b"}});
  const test::Bytes whole = bytes_of(message);
  const std::size_t length_at = whole.size() - message.values.size() * sizeof(double) - sizeof(std::int32_t);
  for (const std::uint32_t lie : {0U, 1U, 3U, 5U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU}) {
    test::Bytes packet = whole;
    for (std::size_t i = 0; i < 4; ++i) packet[length_at + i] = static_cast<std::uint8_t>(lie >> (24U - 8U * i));
    INFO("length " << lie);
    CHECK_FALSE(decode_checked(packet, message).empty());
  }
}

}  // namespace
}  // namespace abs_hil::telemetry
