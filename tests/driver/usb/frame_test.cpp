// The frames of the RT-DAC/USB2, word by word.
#include <random>
#include <string>

#include "catch.hpp"
#include "driver/usb/wire.hpp"

using namespace abs_hil::driver;
using namespace abs_hil::driver::usb;

namespace {

Frame any_frame(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Frame frame{};
  for (std::uint8_t& byte : frame) byte = static_cast<std::uint8_t>(random() >> 56U);
  return frame;
}

}  // namespace

TEST_CASE("The table covers the whole frame, without gap or overlap, each group with a meaning or what is open") {
  std::size_t next = 0;
  for (const WordGroup& group : words()) {
    INFO(std::string(group.name));
    CHECK(group.first == next);
    CHECK(group.count > 0);
    CHECK_FALSE((group.meaning.empty() && group.open.empty() && group.standing != Standing::documented));
    CHECK_FALSE((group.standing == Standing::unknown && group.use != abs_hil::driver::usb::Use::never));
    next = group.first + group.count;
  }
  CHECK(next == 252);
}

TEST_CASE("A frame to the board: the mark, and no other word with bit 15") {
  const Frame shown = any_frame(GENERATE(1U, 2U, 3U));
  const Frame frame = frame_from(shown);
  CHECK(frame[0] == 0x0F);
  CHECK(frame[1] == 0x8F);
  for (std::size_t i = 1; i < frame_words; ++i) {
    INFO(i);
    CHECK((word_at(frame, i) & 0x8000U) == 0);
  }
  // What is not ours goes back as it was shown, in 15 bits: a DAC and a PWM that belong to others.
  CHECK(word_at(frame, 221) == (word_at(shown, 221) & 0x7FFFU));
  CHECK(word_at(frame, 35) == (word_at(shown, 35) & 0x7FFFU));
  // What is the board's own, or not known, is 0.
  for (const std::size_t i : {1U, 9U, 16U, 18U, 53U, 69U, 76U, 199U, 204U}) CHECK(word_at(frame, i) == 0);
  CHECK(word_at(frame, 50) == 0);
  CHECK(word_at(frame, 51) == 0);
}

TEST_CASE("The 16th bit of the prescaler is in the word of the mode") {
  CHECK(pwm_words_for(1, 60, 4095) == PwmWords{60, 2, 4095});
  CHECK(pwm_words_for(1, 0x8001, 0) == PwmWords{1, 3, 0});
  CHECK(pwm_words_for(0, 0xFFFF, 255) == PwmWords{0x7FFF, 1, 255});
  Frame frame{};
  put_payload(frame, 25, 0xABCD);
  CHECK(frame[50] == 0xCD);
  CHECK(frame[51] == 0x2B);
}

TEST_CASE("A frame from the board, laid out by hand") {
  Frame bytes{};
  const auto put = [&](std::size_t word, std::uint16_t value) {
    bytes[2 * word] = static_cast<std::uint8_t>(value & 0xFFU);
    bytes[2 * word + 1] = static_cast<std::uint8_t>(value >> 8U);
  };
  put(0, 103);
  put(8, 0x1234);
  put(14, 0x0005);
  put(20, 60);
  put(21, 2);
  put(22, 0x0ABC);
  put(29, 61);      // PWM 3
  put(53, 0x0001);  // encoder 0
  put(54, 0x8000);
  put(67, 0xFFFF);  // encoder 7
  put(68, 0xFFFF);
  Contents contents;
  REQUIRE(decode(bytes, {.drive_pwm = 0, .brake_pwm = 3, .lower_channel = 0, .upper_channel = 7}, contents) ==
          IoError::none);
  CHECK(contents.identity[0] == 103);
  CHECK(contents.identity[8] == 0x1234);
  CHECK(contents.digital_out == 5);
  CHECK(contents.drive == PwmWords{60, 2, 0x0ABC});
  CHECK(contents.brake == PwmWords{61, 0, 0});
  CHECK(contents.lower_raw == 0x80000001U);
  CHECK(contents.upper_raw == 0xFFFFFFFFU);
}

TEST_CASE("Any other length is refused and leaves the contents unchanged") {
  const std::size_t length = GENERATE(0U, 1U, 64U, 503U, 505U, 512U);
  std::vector<std::uint8_t> bytes(length, 0xAA);
  Contents contents{.upper_raw = 7};
  CHECK(decode(bytes, {}, contents) == IoError::incomplete_answer);
  CHECK(contents.upper_raw == 7);
  CHECK(word_at(bytes, length) == 0);
}
