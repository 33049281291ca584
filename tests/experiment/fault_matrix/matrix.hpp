#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "abs_hil/rig/reason.hpp"
#include "analysis/run_metrics.hpp"
#include "driver/injection/injection.hpp"

namespace abs_hil::experiment::test {

/// What the faults are planted in: the simulated rig, or the driver of the PCI card on the emulated card's registers.
enum class Backend : std::uint8_t { sim, card };

/// One fault in one phase, and what came of it.
struct MatrixCase {
  driver::Injection injection{};
  rig::Reason reason{rig::Reason::none};
  double reaction_s{0.0};  ///< from the first reading or command that the fault acted on to the safe state
  analysis::Metrics metrics{};
  bool safe{false};      ///< drive 0, brake 0, motor disabled, on the simulated wire
  bool complete{false};  ///< every cycle recorded, the last one with the run's reason
  std::string lost{};    ///< what CSV and flight recorder do not hold; empty if they hold all
  [[nodiscard]] bool survived() const { return reason == rig::Reason::sequence_complete; }
};

/// What may come of it, by docs/safety.md.
struct Expectation {
  std::vector<rig::Reason> reasons{};  ///< that are right
  bool may_survive{false};
  double bound_s{0.0};  ///< within which the safe state is reached
};

/// Every signal x kind x phase, in this order. On the card, whose emulation takes ten times as long, while accelerating
/// and while braking alone.
[[nodiscard]] std::vector<driver::Injection> all_injections(Backend backend);
/// @param folder where its files go
[[nodiscard]] MatrixCase run_case(Backend backend, const driver::Injection& injection,
                                  const std::filesystem::path& folder);
[[nodiscard]] analysis::Metrics metrics_without_fault(Backend backend, const std::filesystem::path& folder);
[[nodiscard]] Expectation expected(Backend backend, const driver::Injection& injection);

[[nodiscard]] std::vector<rig::Phase> phases_of(Backend backend);

/// The runs of one backend.
struct Matrix {
  std::vector<MatrixCase> cases{};
  double nominal_m{0.0};  ///< stopping distance without a fault
};
/// docs/fault-matrix.md.
[[nodiscard]] std::string page(const Matrix& sim, const Matrix& card);

}  // namespace abs_hil::experiment::test
