// The points of each kind of design.
#include "study/design.hpp"

#include <boost/random/sobol.hpp>

#include "study/counter_random.hpp"

namespace abs_hil::study {

namespace {

// One stream of random words for each use, so that none repeats another.
constexpr std::uint64_t value_stream = 1;
constexpr std::uint64_t order_stream = 2;
constexpr std::uint64_t shift_stream = 3;

}  // namespace

Design::Design(DesignKind kind, std::uint64_t points, std::uint64_t seed, std::vector<std::string> factors)
    : kind_(kind), points_(points), seed_(seed) {
  for (const std::string& factor : factors) names_.push_back(hash_of(factor));
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
