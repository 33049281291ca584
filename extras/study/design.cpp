// Random words by counter, a permutation without memory, and the points of each kind of design.
#include "study/design.hpp"

#include <bit>
#include <boost/random/sobol.hpp>

#include "rig/formatted_text.hpp"

namespace abs_hil::study {

namespace {

// One stream of random words for each use, so that none repeats another.
constexpr std::uint64_t value_stream = 1;
constexpr std::uint64_t order_stream = 2;
constexpr std::uint64_t shift_stream = 3;

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

Design::Design(DesignKind kind, std::uint64_t points, std::uint64_t seed, std::vector<std::string> factors)
    : kind_(kind), points_(points), seed_(seed) {
  for (const std::string& factor : factors) names_.push_back(rig::hash_of(factor));
  if (names_.empty() || (kind != DesignKind::sobol && kind != DesignKind::saltelli)) return;
  // Point n of the sequence is the sum, modulo 2, of the direction numbers at the bits of n's Gray code. The Gray code
  // of 2^(bit + 1) - 1 has this bit alone. Boost's sequence leaves out point 0.
  directions_.resize(kind == DesignKind::saltelli ? 2 * names_.size() : names_.size());
  boost::random::sobol sequence(directions_.size());
  for (unsigned bit = 0; bit < sobol_bits; ++bit) {
    sequence.seed((std::uint64_t{1} << (bit + 1)) - 2);
    for (auto& dimension : directions_) dimension[bit] = sequence();
  }
}

std::uint64_t Design::rows() const noexcept {
  if (names_.empty()) return 1;
  return kind_ == DesignKind::saltelli ? points_ * (names_.size() + 2) : points_;
}

double Design::sobol_at(std::uint64_t point, std::size_t dimension, std::uint64_t shift) const noexcept {
  std::uint64_t sum = shift;
  std::uint64_t gray = point ^ (point >> 1U);
  for (unsigned bit = 0; gray != 0; ++bit, gray >>= 1U) {
    if ((gray & 1U) != 0) sum ^= directions_[dimension][bit];
  }
  return open_unit(sum);
}

double Design::at(std::uint64_t row, std::size_t factor) const noexcept {
  const std::uint64_t name = names_[factor];
  const auto word = [this, name](std::uint64_t index, std::uint64_t stream) {
    return philox({index, name, 0, 0}, {seed_, stream})[0];
  };
  const auto shift = [&](std::uint64_t matrix) { return seed_ == 0 ? 0 : word(matrix, shift_stream); };
  switch (kind_) {
    case DesignKind::sobol: return sobol_at(row, factor, shift(0));
    case DesignKind::saltelli: {
      // Rows of one point: the first sample, the first with one factor of the second for each factor, the second.
      const std::uint64_t rows_of_point = names_.size() + 2;
      const std::uint64_t place = row % rows_of_point;
      const bool second = place == rows_of_point - 1 || place == factor + 1;
      return sobol_at(row / rows_of_point, second ? names_.size() + factor : factor, shift(second ? 1 : 0));
    }
    case DesignKind::latin_hypercube: {
      const std::uint64_t part = permuted(row, points_, {seed_ ^ name, order_stream});
      return (static_cast<double>(part) + open_unit(word(row, value_stream))) / static_cast<double>(points_);
    }
    default: return open_unit(word(row, value_stream));
  }
}

}  // namespace abs_hil::study
