// docs/fault-matrix.md as text.

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

Written by `scripts/fault_matrix.sh` from the runs of the test `fault_matrix`, which fails when this page is out of date: do
not edit. Every signal, every kind of fault, every phase: the paper's experiment (adaptive, plant `paper-table1`, 1 kHz,
seed 1, idle, coast and stopped 0.3 s long) on the simulated rig and the virtual clock, with one fault that begins 100 ms
(hold: 10 ms) into the phase and stays. [fault-injection.md](fault-injection.md) says what each fault does,
[safety.md](safety.md) what must come of it and why.

A number is the reason of the stop (below), with the time from the first reading or command in which the fault made a
difference to the end of the cycle after which the safe state was on the simulated wire. "goes on": the run went to its end,
with the stopping distance's change where there is one.
In all runs the safe state was reached and the record was whole.
)";

}  // namespace

std::string page(const std::vector<MatrixCase>& cases) {
  const double nominal_m = metrics_without_fault().stop_distance_m;
  std::string text = introduction;
  std::map<int, std::string> reasons;
  std::size_t stopped = 0;
  std::string signal;
  std::string kind;
  for (const MatrixCase& c : cases) {
    if (c.injection.kind == driver::InjectionKind::ok) continue;
    if (driver::name_of(c.injection.signal) != signal) {
      signal = driver::name_of(c.injection.signal);
      text += "\n## " + signal +
              "\n\n| fault | idle | accelerate | coast | brake | hold | stopped |\n|---|---|---|---|---|---|---|";
    }
    if (driver::name_of(c.injection.kind) != kind) {
      kind = driver::name_of(c.injection.kind);
      text += "\n| " + kind + " |";
    }
    text += ' ' + cell(c, nominal_m) + " |";
    if (c.injection.phase == rig::Phase::stopped && c.injection.kind == driver::InjectionKind::intermittent)
      text += '\n';
    if (c.survived()) continue;
    ++stopped;
    reasons[static_cast<int>(c.reason)] = rig::description(c.reason);
  }
  text += "\n## Reasons\n\n| number | reason |\n|---|---|\n";
  for (const auto& [number, words] : reasons) text += "| " + std::to_string(number) + " | " + words + " |\n";
  text += formatted("\n%zu runs, `ok` (no fault) included; %zu stopped, %zu went on.\n", cases.size(), stopped,
                    cases.size() - stopped);
  return text;
}

}  // namespace abs_hil::experiment::test
