#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "abs_hil/rig/reason.hpp"
#include "analysis/run_metrics.hpp"
#include "config/injection.hpp"

namespace abs_hil::experiment::test {

/// Where the faults are injected: the simulated rig, the driver of the PCI card on the emulated card's registers, the
/// driver of a HostMot2 board on the registers of one, or the simulated rig as it was measured in two sessions.
enum class Backend : std::uint8_t { sim, card, hm2, measured_step, measured_relay };
inline constexpr std::array backends{Backend::sim, Backend::card, Backend::hm2, Backend::measured_step,
                                     Backend::measured_relay};
[[nodiscard]] constexpr bool is_board(Backend backend) noexcept {
  return backend == Backend::card || backend == Backend::hm2;
}

/// One fault in one phase, and its result.
struct MatrixCase {
  config::Injection injection{};
  rig::Reason reason{rig::Reason::none};
  double reaction_s{0.0};  ///< from the first affected reading or command to the safe state
  analysis::Metrics metrics{};
  bool safe{false};      ///< drive 0, brake 0, motor disabled, on the simulated wire
  bool complete{false};  ///< every cycle recorded, the last one with the run's reason
  std::string lost{};    ///< what CSV and flight recorder lack; empty if they are complete
  [[nodiscard]] bool survived() const { return reason == rig::Reason::sequence_complete; }
};

/// The permitted result, by docs/safety.md.
struct Expectation {
  std::vector<rig::Reason> reasons{};  ///< permitted reasons
  bool may_survive{false};
  double bound_s{0.0};  ///< longest time to the safe state
};

/// Every signal x kind x phase, in this order. On boards, whose emulation takes ten times as long, only the phases of
/// acceleration and braking.
[[nodiscard]] std::vector<config::Injection> all_injections(Backend backend);
/// @param folder  folder of its files
[[nodiscard]] MatrixCase run_case(Backend backend, const config::Injection& injection,
                                  const std::filesystem::path& folder);
[[nodiscard]] analysis::Metrics metrics_without_fault(Backend backend, const std::filesystem::path& folder);
[[nodiscard]] Expectation expected(Backend backend, const config::Injection& injection);

[[nodiscard]] std::vector<rig::Phase> phases_of(Backend backend);

/// The runs of one backend.
struct Matrix {
  std::vector<MatrixCase> cases{};
  double nominal_m{0.0};  ///< stopping distance without a fault
};
/// The text of docs/reference/fault-matrix.csv.
[[nodiscard]] std::string stored(const std::array<Matrix, backends.size()>& matrices);

}  // namespace abs_hil::experiment::test
