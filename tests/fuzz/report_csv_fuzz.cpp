// Any bytes as a run's CSV: refused with an InputError or read with a row of numbers for every line, times in order.
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "fuzz_input.hpp"
#include "report/csv_reader.hpp"
#include "report/decimation.hpp"
#include "report/input_error.hpp"
#include "report/run_survey.hpp"
#include "report/text.hpp"

namespace {

using abs_hil::fuzz::expect;

const std::filesystem::path& file() {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("report_csv_fuzz_" + std::to_string(::getpid()));
  return path;
}

/// Most inputs never get past the header: they are read once more behind a good one.
void read(const std::string& text) {
  std::ofstream(file(), std::ios::binary) << text;
  try {
    abs_hil::report::CsvReader csv(file());
    abs_hil::report::Decimation decimation(8);
    double last_s = 0.0;
    for (std::size_t rows = 0; csv.next(); ++rows) {
      expect(csv.values().size() == csv.columns().size());
      expect(rows == 0 || csv.time_s() >= last_s);
      last_s = csv.time_s();
      decimation.add(csv.time_s(), csv.values().back());
    }
    expect(decimation.points().size() <= 4 * 8);
    abs_hil::report::RunFiles run;
    run.csv = file();
    const auto survey = abs_hil::report::survey(run);
    expect(survey.rows > 0 && survey.from_s <= survey.to_s);
  } catch (const abs_hil::report::InputError& error) {
    expect(error.what()[0] != '\0');
  }
  std::filesystem::remove(file());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::string clean = abs_hil::report::clean_text(text);
  expect(abs_hil::report::clean_text(clean) == clean);
  expect(abs_hil::report::html_escape(text).find_first_of("<>\"'") == std::string::npos);
  std::string header;
  for (const std::string& column : abs_hil::report::contract_columns()) header += (header.empty() ? "" : ",") + column;
  read(text);
  read(header + '\n' + text);
  return 0;
}
