#pragma once

#include <cstdint>
#include <random>
#include <string_view>
#include <vector>

#include "emulator/can_node.hpp"

namespace abs_hil::emulator {

/// What can be wrong with a node and what else is on its bus. The names are those of the control command
/// `fault NAME[=NUMBER]`.
enum class NodeFaultKind : std::uint8_t {
  ok,          ///< nothing: heals the node
  silent,      ///< sends nothing
  deaf,        ///< takes no command, but answers
  drop,        ///< the next NUMBER answers are lost, then ok
  no_status,   ///< STATUS and OUTPUTS are never sent
  stale,       ///< sequences NUMBER behind
  ahead,       ///< sequences NUMBER ahead
  stuck,       ///< repeats its answer of when the fault began
  duplicate,   ///< sends every frame twice
  swapped,     ///< ends its answer with the counters instead of their time
  wrong_size,  ///< frames are NUMBER bytes long
  corrupt,     ///< wrong checks
  nonsense,    ///< counters jump about
  babble,      ///< NUMBER frames of other identifiers and as many forged ones of its own before each answer
};

/// A node with such a fault between it and the bus.
class NodeFaults {
 public:
  explicit NodeFaults(std::uint64_t seed) : random_(seed) {}

  /// "stale=5". Throws std::invalid_argument, saying what is valid.
  void set(std::string_view text);
  [[nodiscard]] static const char* known();
  /// Whether the node hears this frame.
  [[nodiscard]] bool hears(const BusFrame& frame) const noexcept;
  /// What reaches the bus of one answer.
  [[nodiscard]] std::vector<BusFrame> answer(std::vector<BusFrame> frames);

 private:
  [[nodiscard]] std::vector<BusFrame> changed(std::vector<BusFrame> frames);
  void prepend_babble(std::vector<BusFrame>& frames);

  NodeFaultKind kind_{NodeFaultKind::ok};
  unsigned number_{0};
  std::vector<BusFrame> kept_{};
  std::mt19937_64 random_;
};

/// Puts the right check into a frame's last byte.
void seal(BusFrame& frame) noexcept;

}  // namespace abs_hil::emulator
