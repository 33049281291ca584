// Designs of studies: how points are spread over the ranges of factors, from random numbers that any process can draw
// for any point alone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace abs_hil::study {

/// Philox 4x64 with 10 rounds (Salmon, Moraes, Dror, Shaw 2011): four random words that depend on counter and key
/// alone, so that any point of a design can be drawn without those before it. NumPy's `Philox` is the same generator.
[[nodiscard]] std::array<std::uint64_t, 4> philox(std::array<std::uint64_t, 4> counter,
                                                  std::array<std::uint64_t, 2> key) noexcept;

/// A number in (0, 1), from the upper 52 bits. Neither end occurs, so that every distribution has its quantile.
[[nodiscard]] constexpr double open_unit(std::uint64_t bits) noexcept {
  return (static_cast<double>(bits >> 12U) + 0.5) * 0x1p-52;
}

/// A permutation of 0 to count - 1 that needs no memory: a Feistel network over the next larger power of four, walked
/// until it falls below `count` (Black, Rogaway 2002). @param index  < count
[[nodiscard]] std::uint64_t permuted(std::uint64_t index, std::uint64_t count,
                                     std::array<std::uint64_t, 2> key) noexcept;

/// How the points of a study are spread over the ranges of its factors.
enum class DesignKind : std::uint8_t {
  grid,             ///< no ranges: one point
  random,           ///< independent
  sobol,            ///< Sobol's sequence: even at 2^n points
  latin_hypercube,  ///< each factor has one point in each of `points` equal parts of its range
  saltelli,         ///< the samples of Sobol's sensitivity indices (Saltelli 2010), points * (factors + 2) rows
};

/// The points of a design in the unit cube. Point number `row` depends on the arguments of the constructor and `row`
/// alone, so every computer can draw any part of a design. Thread-safe.
class Design {
 public:
  /// @param points  of the design, >= 1
  /// @param seed  of what is random in it. Sobol's sequence with seed 0 is the plain one, with another seed each factor
  ///   has a digital shift
  /// @param factors  names of the factors with ranges. In the designs random, latin_hypercube and the shift of the
  /// others,
  ///   the values of one factor do not depend on which other factors there are
  Design(DesignKind kind, std::uint64_t points, std::uint64_t seed, std::vector<std::string> factors);

  /// Number of points, with saltelli of rows.
  [[nodiscard]] std::uint64_t rows() const noexcept;
  /// The value in (0, 1) of a factor. @param row  < rows() @param factor  < number of factors
  [[nodiscard]] double at(std::uint64_t row, std::size_t factor) const noexcept;

 private:
  static constexpr unsigned sobol_bits = 48;  ///< of the index of a point

  [[nodiscard]] double sobol_at(std::uint64_t point, std::size_t dimension, std::uint64_t shift) const noexcept;

  DesignKind kind_;
  std::uint64_t points_;
  std::uint64_t seed_;
  std::vector<std::uint64_t> names_;                               ///< hashes of the factors' names
  std::vector<std::array<std::uint64_t, sobol_bits>> directions_;  ///< direction numbers of Sobol's dimensions
};

}  // namespace abs_hil::study
