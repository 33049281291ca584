// usage: run_bits TABLE CONFIG_FOLDER [--write | --rows WORDS]
//
// Every platform computes the same bits: makes the runs of the table and compares the SHA-256 of their rows, in the
// CSV's text, with those in the table. Needs no Python, so that it tries the simulation core on any platform, under an
// emulator too. --write prints the table anew, --rows the rows of the run of the options WORDS, to see where two
// platforms part. python/tests/test_bits.py holds the package to the same table.
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/config_file.hpp"
#include "config/merge.hpp"
#include "rig/record_sink.hpp"
#include "run/run.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/csv_sink.hpp"

namespace {

using namespace abs_hil;

class Records : public rig::RecordSink {
 public:
  void consume(const rig::CycleRecord& record, double distance_m) override { rows_.emplace_back(record, distance_m); }
  [[nodiscard]] std::string text(const rig::RunNames& names) const {
    std::string all;
    for (const auto& [record, distance_m] : rows_) {
      char row[telemetry::csv_row_max_bytes];
      all.append(row, telemetry::format_csv_row(record, distance_m, row, names));
    }
    return all;
  }

 private:
  std::vector<std::pair<rig::CycleRecord, double>> rows_;
};

std::string rows_of_run(const std::string& words) {
  std::istringstream text(words);
  const std::vector<std::string> options{std::istream_iterator<std::string>(text), {}};
  const config::Configuration request = config::merge(config::sources_of(options));
  Records records;
  const run::Simulation simulation =
      run::simulate(request.settings, *request.script, {&records}, [] { return rig::Reason::none; });
  return records.text(simulation.names);
}

int compare(const char* table, bool write) {
  std::ifstream file(table);
  int runs = 0;
  int other = 0;
  for (std::string line; std::getline(file, line);) {
    const std::size_t tab = line.find('\t');
    if (tab == std::string::npos) continue;
    const std::string words = line.substr(tab + 1);
    const std::string got = run_folder::sha256_of(rows_of_run(words));
    ++runs;
    if (write) {
      std::printf("%s\t%s\n", got.c_str(), words.c_str());
    } else if (got != line.substr(0, tab)) {
      ++other;
      std::printf("other bits: %s\n", words.c_str());
    }
  }
  if (!write) std::printf("%d runs, %d with other bits\n", runs, other);
  return runs > 0 && other == 0 ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    if (count < 3) throw std::invalid_argument("usage: run_bits TABLE CONFIG_FOLDER [--write]");
    config::set_own_config_dir(arguments[2]);
    if (count > 4) {
      std::fputs(rows_of_run(arguments[4]).c_str(), stdout);
      return 0;
    }
    return compare(arguments[1], count > 3);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "run_bits: %s\n", error.what());
    return 2;
  }
}
