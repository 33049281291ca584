#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string_view>

#include "emulator/card_model.hpp"

namespace abs_hil::emulator {

/// What can be wrong with one register. The names are those of `--fault OFFSET:NAME[=PARAMETER]`.
enum class FaultKind : std::uint8_t {
  ok,            ///< nothing: heals the register
  stuck,         ///< reads what it read when the fault began; writes are lost
  wrong,         ///< reads its value plus the parameter
  slow,          ///< each access takes the parameter in us
  delayed,       ///< reads what it would have read so many reads ago (parameter)
  intermittent,  ///< each access fails with the probability given
  off,           ///< every access fails
  garbage,       ///< reads anything
};

struct Fault {
  FaultKind kind{FaultKind::ok};
  double parameter{0.0};
};

/// One access as the host gets it.
struct AccessResult {
  bool failed{false};
  std::uint32_t value{0};
  std::int64_t delay_ns{0};  ///< to wait before answering
};

/// A card with faults in single registers, or none at all on the bus (all ones).
class FaultyCard {
 public:
  FaultyCard(CardModel& card, std::uint64_t seed) : card_(card), random_(seed) {}

  /// Begins or (`ok`) ends a fault of the register at `offset`.
  void set(std::uint32_t offset, const Fault& fault);
  /// "88:delayed=3", "0x6c:stuck". Throws std::invalid_argument, saying what is valid.
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
