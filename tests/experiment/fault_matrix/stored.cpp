// The results of all runs as they stand in docs/reference/fault-matrix.csv.

#include <array>
#include <cstdio>

#include "matrix.hpp"

namespace abs_hil::experiment::test {

namespace {

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

/// Reason and time of a run that stopped; the change of the stop distance of one that went on, if one can see it.
std::string result(const MatrixCase& c, double nominal_m) {
  if (!c.survived()) return formatted("%d,%.0f,", static_cast<int>(c.reason), c.reaction_s * 1e3);
  const double longer = 100.0 * (c.metrics.stop_distance_m / nominal_m - 1.0);
  return longer > 0.05 || longer < -0.05 ? formatted(",,%+.1f", longer) : ",,";
}

std::string rows(const Matrix& matrix, const std::string& backend) {
  std::string text;
  for (const MatrixCase& c : matrix.cases) {
    if (c.injection.kind == config::InjectionKind::ok) continue;
    text.append(backend).append(",").append(rig::name_of(c.injection.phase.value())).append(",");
    text.append(config::name_of(c.injection.signal)).append(",").append(config::name_of(c.injection.kind));
    text += ',' + result(c, matrix.nominal_m) + '\n';
  }
  return text;
}

}  // namespace

std::string stored(const std::array<Matrix, backends.size()>& matrices) {
  constexpr std::array names{"sim", "card", "hm2", "measured-step", "measured-relay"};
  std::string text = "backend,phase,signal,fault,reason,after_ms,stop_distance_change_percent\n";
  for (std::size_t i = 0; i < matrices.size(); ++i) text += rows(matrices[i], names[i]);
  return text;
}

}  // namespace abs_hil::experiment::test
