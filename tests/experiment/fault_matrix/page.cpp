// docs/fault-matrix.md as text.

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>

#include "matrix.hpp"

namespace abs_hil::experiment::test {

namespace {

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

std::string cell(const MatrixCase& c, double nominal_m) {
  if (!c.survived()) {
    return formatted("%d after %.0f ms", static_cast<int>(c.reason), c.reaction_s * 1e3);
  }
  const double longer = 100.0 * (c.metrics.stop_distance_m / nominal_m - 1.0);
  return longer > 0.05 || longer < -0.05 ? formatted("goes on, %+.1f %%", longer) : "goes on";
}

constexpr const char* introduction = R"(# Fault matrix

Do not edit: `scripts/fault_matrix.sh` writes this page from the runs of the test `fault_matrix`, which fails if the
page is out of date. The tables cover every signal, every kind of fault and every phase. Each run is the paper's
experiment (adaptive, plant `paper-table1`, 1 kHz, seed 1, idle, coast and stopped 0.3 s long) on the virtual clock.
One fault begins 100 ms (hold: 10 ms) into the phase and stays. The first part uses the simulated rig. The second part
uses the driver of the PCI card on the registers of the emulated card, with the brake limited to 0.7 and faults during
acceleration and braking. [fault-injection.md](fault-injection.md) describes each fault, [safety.md](safety.md) the
required reaction and its reason.

A number is the reason of the stop (below). The time after it counts from the first reading or command that the fault
changed to the end of the cycle after which the safe state was on the wire. "goes on" means that the run reached its
end; a percentage gives the change of the stop distance.
All runs reached the safe state, and the CSV held every cycle up to the last. After every fault the flight recorder
held the last 2 s and the reason, in memory and in its three files.
)";

}  // namespace

namespace {

std::string table_head(Backend backend) {
  std::string names = "\n\n| fault |";
  std::string rule = "\n|---|";
  for (const rig::Phase phase : phases_of(backend)) {
    names.append(" ").append(rig::name_of(phase)).append(" |");
    rule += "---|";
  }
  return names + rule;
}

/// The tables of one backend, one section per signal; collects the reasons that occurred.
std::string tables(const Matrix& matrix, Backend backend, std::map<int, std::string>& reasons) {
  std::string text;
  std::string signal;
  std::string kind;
  for (const MatrixCase& c : matrix.cases) {
    if (c.injection.kind == driver::InjectionKind::ok) continue;
    if (driver::name_of(c.injection.signal) != signal) {
      signal = driver::name_of(c.injection.signal);
      text += "\n### " + signal + (backend == Backend::card ? ", on the card" : ", simulated") + table_head(backend);
    }
    if (driver::name_of(c.injection.kind) != kind) {
      kind = driver::name_of(c.injection.kind);
      text += "\n| " + kind + " |";
    }
    text += ' ' + cell(c, matrix.nominal_m) + " |";
    if (c.injection.phase == phases_of(backend).back() && c.injection.kind == driver::InjectionKind::intermittent)
      text += '\n';
    if (!c.survived()) reasons[static_cast<int>(c.reason)] = rig::description(c.reason);
  }
  const auto stopped = static_cast<std::size_t>(
      std::count_if(matrix.cases.begin(), matrix.cases.end(), [](const MatrixCase& c) { return !c.survived(); }));
  return text + formatted("\n%zu runs, `ok` (no fault) included; %zu stopped, %zu went on.\n", matrix.cases.size(),
                          stopped, matrix.cases.size() - stopped);
}

}  // namespace

std::string page(const Matrix& sim, const Matrix& card) {
  std::map<int, std::string> reasons;
  std::string text = introduction;
  text += "\n## On the simulated rig\n" + tables(sim, Backend::sim, reasons);
  text += "\n## On the emulated card\n" + tables(card, Backend::card, reasons);
  text += "\n## Reasons\n\n| number | reason |\n|---|---|\n";
  for (const auto& [number, words] : reasons) text += "| " + std::to_string(number) + " | " + words + " |\n";
  return text;
}

}  // namespace abs_hil::experiment::test
