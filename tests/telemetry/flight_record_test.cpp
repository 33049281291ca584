// The files of a flight record.

#include "telemetry/flight_record.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "catch.hpp"
#include "rig/controller_signal.hpp"
#include "telemetry/csv_sink.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::telemetry;

namespace {

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("the flight record has the controller's own signals, by their names") {
  const test::TemporaryFolder folder;
  std::array<rig::CycleRecord, 2> records{};
  records[1].sequence = 1;
  records[1].control.signals[0] = 0.25;
  records[1].control.signals[1] = -3.0;
  std::vector<std::string> problems;
  ExperimentInfo experiment{};
  experiment.names.signals = {"I_m", "zeta_N"};
  const double own = static_cast<double>(rig::controller_signals.size() + 1);
  const auto written = write_flight_record(
      folder.path / "flight",
      {.records = records, .reason = rig::Reason::controller_not_finite, .reason_value = own, .account = "a test\n"},
      experiment, "ABS_", problems);
  CHECK(problems.empty());
  CHECK(written.size() == 3);
  CHECK_THAT(content(folder.path / "flight.txt"), Catch::Matchers::Contains("not a finite number: zeta_N\n"));
  std::istringstream lines(content(folder.path / "flight.csv"));
  std::string header, first, second;
  std::getline(lines, header);
  std::getline(lines, first);
  std::getline(lines, second);
  CHECK(header == std::string(csv_header).append(flight_csv_extra_header).append(",I_m,zeta_N"));
  CHECK_THAT(first, Catch::Matchers::EndsWith(",NaN,NaN"));
  CHECK_THAT(second, Catch::Matchers::EndsWith(",0.25,-3"));
}
