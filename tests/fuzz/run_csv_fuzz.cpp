// Any bytes as a run's CSV: refused with an InputError or read with a row of numbers for every line, times in order.
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "fuzz_input.hpp"
#include "run_folder/clean_text.hpp"
#include "run_folder/csv_reader.hpp"
#include "run_folder/input_error.hpp"

namespace {

using abs_hil::fuzz::expect;

const std::filesystem::path& file() {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("run_csv_fuzz_" + std::to_string(::getpid()));
  return path;
}

/// Most inputs never get past the header: they are read once more behind a good one.
void read(const std::string& text) {
  std::ofstream(file(), std::ios::binary) << text;
  try {
    abs_hil::run_folder::CsvReader csv(file());
    double last_s = 0.0;
    for (std::size_t rows = 0; csv.next(); ++rows) {
      expect(csv.values().size() == csv.columns().size());
      expect(rows == 0 || csv.time_s() >= last_s);
      last_s = csv.time_s();
    }
  } catch (const abs_hil::run_folder::InputError& error) {
    expect(error.what()[0] != '\0');
  }
  std::filesystem::remove(file());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::string clean = abs_hil::run_folder::clean_text(text);
  expect(abs_hil::run_folder::clean_text(clean) == clean);
  std::string header;
  for (const std::string& column : abs_hil::run_folder::contract_columns())
    header += (header.empty() ? "" : ",") + column;
  read(text);
  read(header + '\n' + text);
  return 0;
}
