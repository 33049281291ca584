// Any bytes as the answers of an hm2 board: it is refused with a message or driven within its bounds; counts never jump
// beyond what the wheels can do, and no answer but one to the present request is used.
// Input: records "kind, bytes ..."; kind says whether the answer has the right length, its number, or is the board's
// own.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <vector>

#include "driver/hm2/hm2_driver.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace abs_hil::driver;
using namespace abs_hil::fuzz;

unsigned word_of(std::uint8_t low, std::uint8_t high) { return low | static_cast<unsigned>(high) << 8U; }

/// The words that a 7I92 would answer, and the input's bytes in place of some of them.
class FuzzLink final : public hm2::Link {
 public:
  explicit FuzzLink(Input& input) : input_(input) {}
  int send(std::span<const std::uint8_t> request) noexcept override {
    std::vector<std::uint8_t> answer;
    for (std::size_t i = 0; i + 4 <= request.size();) {
      const unsigned word = word_of(request[i], request[i + 1]);
      unsigned address = word_of(request[i + 2], request[i + 3]);
      i += 4;
      const unsigned width = 1U << ((word >> 8U) & 3U);
      const bool scratch = ((word >> 10U) & 7U) == hm2::space::timers && address >= 0x10;
      for (unsigned byte = 0; byte < (word & 0x7FU) * width; ++byte, ++address) {
        if ((word & 0x8000U) != 0) {
          if (scratch && i < request.size()) scratch_[address & 7U] = request[i];
          ++i;
        } else {
          answer.push_back(scratch ? scratch_[address & 7U] : honest((word >> 10U) & 7U, address));
        }
      }
    }
    if (answer.empty()) return 0;
    const unsigned kind = input_.byte();
    if ((kind & 1U) != 0) {  // some words lie, the numbers do not
      for (int lies = input_.byte() % 8; lies > 0; --lies) {
        const std::uint8_t low = input_.byte();
        answer[word_of(low, input_.byte()) % answer.size()] = input_.byte();
      }
    }
    if ((kind & 6U) == 6U) answer.resize(input_.byte());
    if ((kind & 24U) == 24U) return 0;  // lost
    answers_.push_back(answer);
    if ((kind & 96U) == 96U) answers_.push_back(answer);
    return 0;
  }
  std::size_t receive(std::span<std::uint8_t> buffer, std::int64_t) noexcept override {
    if (answers_.empty()) return 0;
    const auto answer = answers_.front();
    answers_.pop_front();
    std::copy_n(answer.begin(), std::min(answer.size(), buffer.size()), buffer.begin());
    return answer.size();
  }

 private:
  static std::uint8_t honest(unsigned space, unsigned address) {
    if (space == hm2::space::board_info) return address == 0x10 ? 3 : 0;
    if (space != hm2::space::hostmot2) return 0;
    const auto word = [&]() -> std::uint32_t {
      constexpr std::array<std::uint32_t, 16> idrom{3,  64, 512,         0x4153454D,  0x32394937, 9,  34,  2,
                                                    34, 17, 100'000'000, 200'000'000, 4,          64, 256, 4};
      constexpr std::array<std::uint32_t, 12> modules{0x01010002, 0x00030C00, 0, 0x02010003, 0x00051000, 0x1F,
                                                      0x02010204, 0x00053000, 3, 0x02020006, 0x00054000, 3};
      const unsigned at = address & ~3U;
      if (at == 0x100) return 0x55AACAFE;
      if (at == 0x104) return 0x54534F48;
      if (at == 0x108) return 0x32544F4D;
      if (at == 0x10C) return 0x400;
      if (at >= 0x400 && at < 0x440) return idrom[(at - 0x400) / 4];
      if (at >= 0x440 && at < 0x470) return modules[(at - 0x440) / 4];
      if (at == 0x604) return 0x03000681;
      if (at == 0x648) return 0x03010681;
      return at >= 0x600 && at < 0x700 ? 0x03000000 : 0;
    }();
    return static_cast<std::uint8_t>(word >> (8U * (address & 3U)));
  }
  Input& input_;
  std::array<std::uint8_t, 8> scratch_{};
  std::deque<std::vector<std::uint8_t>> answers_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  hm2::Hm2Driver driver({}, [&input] { return std::make_unique<FuzzLink>(input); });
  try {
    driver.configure();
    const hm2::Board& board = driver.board();
    expect(board.pins.size() == std::size_t{board.ports} * board.port_width && board.pins.size() <= 256);
    expect(board.counter.instances <= 32 && board.pwm.instances <= 32);
    expect(board.pwm.address(hm2::reg::enable) > board.pwm.base);
    driver.activate(0);
  } catch (const Unavailable& refused) {
    expect(std::strlen(refused.what()) > 20);
    return 0;
  }
  abs_hil::rig::Measurement before;
  for (std::int64_t cycle = 1; cycle < 200 && !input.empty(); ++cycle) {
    constexpr std::int64_t ms = 1'000'000;
    abs_hil::rig::Measurement now;
    abs_hil::rig::Command sent;
    const bool good = driver.read(cycle * ms, now).ok();
    if (good && cycle > 1) {
      // 1000 rad/s and some slack; a cycle without its answer shows the counts before.
      const double most = 256.0 + 652.0 * static_cast<double>(now.time_ns - before.time_ns) / ms;
      expect(std::abs(static_cast<double>(now.upper_counts) - before.upper_counts) <= most);
      expect(std::abs(static_cast<double>(now.lower_counts) - before.lower_counts) <= most);
    }
    if (good) before = now;
    static_cast<void>(driver.write({.motor_duty = 0.5, .motor_enable = true}, sent));
    expect(sent.motor_duty >= 0.0 && sent.motor_duty <= 0.5);
  }
  return 0;
}
