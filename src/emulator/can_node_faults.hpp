#pragma once

#include <cstdint>
#include <random>
#include <string_view>
#include <vector>

#include "emulator/can_node.hpp"

namespace abs_hil::emulator {

/// Faults of a node and of its bus. The names are those of the control command `fault NAME[=NUMBER]`.
enum class NodeFaultKind : std::uint8_t {
  ok,          ///< no fault: heals the node
  silent,      ///< sends nothing
  deaf,        ///< takes no command, but answers
  drop,        ///< the next NUMBER answers are lost, then ok
  no_status,   ///< STATUS and OUTPUTS are never sent
  stale,       ///< sequences NUMBER behind
  ahead,       ///< sequences NUMBER ahead
  stuck,       ///< repeats the answer that it gave when the fault began
  duplicate,   ///< sends every frame twice
  swapped,     ///< ends its answer with the counters instead of their time
  wrong_size,  ///< frames are NUMBER bytes long
  corrupt,     ///< wrong checksums
  nonsense,    ///< random counters
  babble,      ///< NUMBER frames of other identifiers and as many forged ones of its own before each answer
};

/// Applies a fault between a node and its bus.
class NodeFaults {
 public:
  explicit NodeFaults(std::uint64_t seed) : random_(seed) {}

  /// Sets a fault such as "stale=5". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  /// True if the node receives this frame.
  [[nodiscard]] bool hears(const BusFrame& frame) const noexcept;
  /// The frames of one answer that reach the bus.
  [[nodiscard]] std::vector<BusFrame> answer(std::vector<BusFrame> frames);

 private:
  [[nodiscard]] std::vector<BusFrame> changed(std::vector<BusFrame> frames);
  void prepend_babble(std::vector<BusFrame>& frames);

  NodeFaultKind kind_{NodeFaultKind::ok};
  unsigned number_{0};
  std::vector<BusFrame> kept_{};
  std::mt19937_64 random_;
};

}  // namespace abs_hil::emulator
