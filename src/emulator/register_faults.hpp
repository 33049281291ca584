#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string_view>

#include "emulator/card_model.hpp"

namespace abs_hil::emulator {

/// Faults of one register. The names are those of `--fault OFFSET:NAME[=PARAMETER]`.
enum class FaultKind : std::uint8_t {
  ok,            ///< no fault: heals the register
  stuck,         ///< keeps the value that it had when the fault began; writes are lost
  wrong,         ///< reads its value plus the parameter
  slow,          ///< each access takes the parameter in us
  delayed,       ///< reads the value of n reads ago (n: parameter)
  intermittent,  ///< each access fails with the given probability
  off,           ///< every access fails
  garbage,       ///< reads random values
};

struct Fault {
  FaultKind kind{FaultKind::ok};
  double parameter{0.0};
};

/// Result of one access for the host.
struct AccessResult {
  bool failed{false};
  std::uint32_t value{0};
  std::int64_t delay_ns{0};  ///< delay of the answer
};

/// A card with faults in single registers, or a card that is missing on the bus (all ones).
class FaultyCard {
 public:
  FaultyCard(CardModel& card, std::uint64_t seed) : card_(card), random_(seed) {}

  /// Begins or (`ok`) ends a fault of the register at `offset`.
  void set(std::uint32_t offset, const Fault& fault);
  /// Sets a fault such as "88:delayed=3" or "0x6c:stuck". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  void answer_all_ones(bool on) noexcept { all_ones_ = on; }

  AccessResult read32(std::uint32_t offset);
  AccessResult write32(std::uint32_t offset, std::uint32_t value);

 private:
  struct State {
    Fault fault{};
    std::uint32_t stuck_at{0};
    std::deque<std::uint32_t> earlier{};
  };
  [[nodiscard]] bool fails(const Fault& fault);

  CardModel& card_;
  std::mt19937_64 random_;
  std::map<std::uint32_t, State> faults_{};
  bool all_ones_{false};
};

}  // namespace abs_hil::emulator
