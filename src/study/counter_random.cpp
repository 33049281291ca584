#include "study/counter_random.hpp"

#include <bit>

namespace abs_hil::study {

namespace {

__extension__ using Wide = unsigned __int128;  // C++ has no product of two words in full

struct Product {
  std::uint64_t high;
  std::uint64_t low;
};

constexpr Product product(std::uint64_t a, std::uint64_t b) noexcept {
  const Wide wide = static_cast<Wide>(a) * b;
  return {static_cast<std::uint64_t>(wide >> 64U), static_cast<std::uint64_t>(wide)};
}

constexpr int philox_rounds = 10;
constexpr int feistel_rounds = 6;

}  // namespace

std::array<std::uint64_t, 4> philox(std::array<std::uint64_t, 4> counter, std::array<std::uint64_t, 2> key) noexcept {
  for (int round = 0; round < philox_rounds; ++round) {
    const Product first = product(0xD2E7470EE14C6C93U, counter[0]);
    const Product second = product(0xCA5A826395121157U, counter[2]);
    counter = {second.high ^ counter[1] ^ key[0], second.low, first.high ^ counter[3] ^ key[1], first.low};
    key[0] += 0x9E3779B97F4A7C15U;
    key[1] += 0xBB67AE8584CAA73BU;
  }
  return counter;
}

std::uint64_t permuted(std::uint64_t index, std::uint64_t count, std::array<std::uint64_t, 2> key) noexcept {
  if (count < 2) return index;
  const auto half = static_cast<unsigned>((std::bit_width(count - 1) + 1) / 2);
  const std::uint64_t mask = (std::uint64_t{1} << half) - 1;
  do {
    std::uint64_t left = index >> half;
    std::uint64_t right = index & mask;
    for (std::uint64_t round = 0; round < feistel_rounds; ++round) {
      const std::uint64_t mixed = left ^ (philox({right, round, count, 0}, key)[0] & mask);
      left = right;
      right = mixed;
    }
    index = (left << half) | right;
  } while (index >= count);
  return index;
}

}  // namespace abs_hil::study
