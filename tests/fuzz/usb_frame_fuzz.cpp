// Any bytes for frames: the decoder and the driver behind it neither crash nor hand on what no rig can say, and no
// frame that is sent breaks the rule of 15 bits.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "driver/board_kit.hpp"
#include "driver/usb/usb_driver.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::fuzz;

/// A first frame like a board's, and every later answer as the input has it; short ones too.
class FuzzedLink final : public usb::FrameLink {
 public:
  explicit FuzzedLink(Input& input) : input_(input) {}
  IoResult send(const usb::Frame& frame) noexcept override {
    sent_ = frame;
    expect(frame[0] == 0x0F && frame[1] == 0x8F);
    for (std::size_t i = 1; i < usb::frame_words; ++i) expect(usb::word_at(frame, i) <= usb::payload_bits);
    return {};
  }
  IoResult request() noexcept override { return {}; }
  [[nodiscard]] bool answer_outstanding() const noexcept override { return false; }
  IoResult receive(std::int64_t /*timeout_ns*/, std::span<const std::uint8_t>& bytes) noexcept override {
    const std::uint8_t how = input_.byte();
    switch (how % 8) {
      case 0: return {IoError::no_answer, usb::endpoint_in};
      case 1: return {IoError::stalled, usb::endpoint_in};
      case 2: answer_size_ = how * 3U; break;
      default: answer_size_ = usb::frame_bytes; break;
    }
    // What the board would show of what was sent; then the input's bytes over the counters, or over all of it.
    answer_.fill(0);
    std::copy(sent_.begin() + 20, sent_.end(), answer_.begin() + 20);
    const std::size_t from = how % 8 == 3 ? 0 : 2 * usb::word::encoder_counter;
    const auto over = input_.bytes(how % 8 == 3 ? usb::frame_bytes : 32);
    std::copy(over.begin(), over.end(), answer_.begin() + static_cast<std::ptrdiff_t>(from));
    bytes = std::span(answer_).first(answer_size_);
    return {};
  }
  IoResult flush(std::int64_t /*timeout_ns*/) noexcept override { return {}; }
  void recover() noexcept override {}

 private:
  Input& input_;
  usb::Frame sent_{};
  std::array<std::uint8_t, 1024> answer_{};
  std::size_t answer_size_{0};
};

void decode_raw(std::span<const std::uint8_t> bytes) {
  usb::Contents contents;
  const IoError error = usb::decode(bytes, {.brake_pwm = 9, .upper_channel = 7}, contents);
  expect((error == IoError::none) == (bytes.size() == usb::frame_bytes));
}

void run_driver(Input& input) {
  constexpr std::int64_t ms = 1'000'000;
  usb::UsbOptions options;
  const std::uint8_t flags = input.byte();
  options.upper_channel = 1 + flags % 7;
  options.lower_channel = 0;
  options.upper_sign = (flags & 8U) != 0 ? -1 : 1;
  options.enable_line = flags % 16 - 1;
  options.verify_outputs = (flags & 64U) != 0;
  const auto own = usb::usb_driver(options, [&input] {
    usb::Board board{.place = "fuzzed"};
    board.link = std::make_unique<FuzzedLink>(input);
    return board;
  });
  RigDriver& driver = *own;
  try {
    driver.configure();
    driver.activate(0);
  } catch (const Unavailable&) {
    return;
  }
  rig::Measurement before{};
  for (std::int64_t cycle = 1; cycle < 200 && !input.empty(); ++cycle) {
    rig::Measurement m;
    const IoResult result = driver.read(cycle * ms, m);
    if (!result.ok()) {
      expect(result.reason != rig::Reason::none);
      static_cast<void>(driver.write(rig::safe_command));
      continue;
    }
    expect(m.time_ns >= before.time_ns && m.time_ns <= cycle * ms);
    expect(m.trip_flags == 0 && std::isnan(m.supply_V) && std::isnan(m.temperature_C) && !m.ideal_speeds);
    for (const auto& [was, is] :
         {std::pair(before.upper_counts, m.upper_counts), std::pair(before.lower_counts, m.lower_counts)}) {
      expect(plausible_travel(was, is, m.time_ns - before.time_ns, options));
    }
    before = m;
    static_cast<void>(driver.write({.brake_duty = static_cast<double>(input.byte()) / 255.0}));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  decode_raw({data, size});
  Input input(data, size);
  run_driver(input);
  return 0;
}
