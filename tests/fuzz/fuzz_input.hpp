#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

namespace abs_hil::fuzz {

/// What must hold whatever the input; the fuzzer keeps the input for which it does not.
inline void expect(bool holds) {
  if (!holds) std::abort();
}

/// Takes the input apart; 0 once it is used up.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}
  [[nodiscard]] bool empty() const { return rest_.empty(); }
  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const std::uint8_t value = rest_[0];
    rest_ = rest_.subspan(1);
    return value;
  }
  /// So many bytes, or what is left of them.
  std::span<const std::uint8_t> bytes(std::size_t count) {
    const auto part = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(part.size());
    return part;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace abs_hil::fuzz
