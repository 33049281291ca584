#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "abs_hil/analysis/run_metrics.hpp"
#include "abs_hil/driver/injection/injection.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::experiment::test {

/// One fault in one phase, and what came of it.
struct MatrixCase {
  driver::Injection injection{};
  rig::Reason reason{rig::Reason::none};
  double reaction_s{0.0};  ///< from the first reading or command that the fault acted on to the safe state
  analysis::Metrics metrics{};
  bool safe{false};      ///< drive 0, brake 0, motor disabled, on the simulated wire
  bool complete{false};  ///< every cycle recorded, the last one with the run's reason
  [[nodiscard]] bool survived() const { return reason == rig::Reason::sequence_complete; }
};

/// What may come of it, by docs/safety.md.
struct Expectation {
  std::vector<rig::Reason> reasons{};  ///< that are right
  bool may_survive{false};
  double bound_s{0.0};  ///< within which the safe state is reached
};

/// Every signal x kind x phase, in this order.
[[nodiscard]] std::vector<driver::Injection> all_injections();
[[nodiscard]] MatrixCase run_case(const driver::Injection& injection);
[[nodiscard]] analysis::Metrics metrics_without_fault();
[[nodiscard]] Expectation expected(const driver::Injection& injection);
/// docs/fault-matrix.md.
[[nodiscard]] std::string page(const std::vector<MatrixCase>& cases);

}  // namespace abs_hil::experiment::test
