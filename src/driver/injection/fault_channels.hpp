#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "driver/injection/injection.hpp"
#include "rig/encoder_scale.hpp"

// The effect of an injected fault on one signal. All functions except the constructors are real-time safe.
namespace abs_hil::driver {

/// A number in [0, 1) from the generator's upper 32 bits: the same with every standard library.
[[nodiscard]] inline double uniform(std::mt19937_64& random) noexcept {
  return static_cast<double>(random() >> 32U) * 0x1p-32;
}

/// The fault that currently acts on a signal.
struct ActiveFault {
  InjectionKind kind{InjectionKind::ok};
  double parameter{0.0};
};

/// Queue of values that are delivered late. If it overflows, the oldest value is lost.
template <typename Value>
class DelayLine {
 public:
  DelayLine() : waiting_(capacity) {}
  void push(std::int64_t now_ns, const Value& value) noexcept {
    waiting_[(first_ + size_) % capacity] = {now_ns, value};
    if (size_ < capacity) {
      ++size_;
    } else {
      first_ = (first_ + 1) % capacity;
    }
  }
  /// Takes the oldest value if it was pushed at `until_ns` or before.
  [[nodiscard]] bool pop(std::int64_t until_ns, Value& value) noexcept {
    if (size_ == 0 || waiting_[first_].came_ns > until_ns) return false;
    value = waiting_[first_].value;
    first_ = (first_ + 1) % capacity;
    --size_;
    return true;
  }
  void clear() noexcept { size_ = 0; }

 private:
  static constexpr std::size_t capacity = 5001;  ///< half a second at 10 kHz
  struct Entry {
    std::int64_t came_ns{0};
    Value value{};
  };
  std::vector<Entry> waiting_;
  std::size_t first_{0};
  std::size_t size_{0};
};

[[nodiscard]] inline std::int64_t ns_of(double seconds) noexcept { return std::llround(seconds * 1e9); }

/// One encoder's counter. As with a real incremental encoder, lost counts stay lost: after the fault the counter
/// continues from its current value.
class EncoderChannel {
 public:
  /// Starts anew with the counter's first reading.
  void start(std::int32_t counts) noexcept;
  /// Counts travelled since the previous reading.
  [[nodiscard]] std::int32_t travel(std::int32_t counts) noexcept;
  /// The part of `travel` that is delivered under the fault.
  [[nodiscard]] std::int32_t pass(std::int32_t travel, const ActiveFault& fault, std::int64_t now_ns,
                                  std::mt19937_64& random) noexcept;

 private:
  void advance(std::int64_t travel) noexcept;

  std::int32_t last_{0};
  std::int32_t delivered_{0};
  double fraction_{0.0};  ///< fraction of a count left over (kind `wrong`)
  std::int64_t held_{0};  ///< counts to be delivered later
  std::int64_t renewed_ns_{0};
  DelayLine<std::int64_t> line_{};
};

/// How a number fails.
struct NumberFaults {
  double off{0.0};
  double garbage_least{0.0};
  double garbage_most{1.0};
  bool whole{false};  ///< garbage values are whole numbers
  double (*wrong)(double value, double parameter) noexcept;
  bool intermittently_wrong{false};  ///< an intermittent fault acts as `wrong`, not as `off`
};

/// A signal that is a number: a duty, a voltage, a flag, a time.
class NumberChannel {
 public:
  explicit NumberChannel(const NumberFaults& faults) : faults_(faults) {}
  /// Starts anew, with nothing delivered.
  void start() noexcept;
  [[nodiscard]] double pass(double value, const ActiveFault& fault, std::int64_t now_ns,
                            std::mt19937_64& random) noexcept;

 private:
  NumberFaults faults_;
  double delivered_{0.0};
  std::int64_t renewed_ns_{0};
  DelayLine<double> line_{};
};

}  // namespace abs_hil::driver
