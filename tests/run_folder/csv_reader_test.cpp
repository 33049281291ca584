#include "run_folder/csv_reader.hpp"

#include <unistd.h>

#include <cmath>
#include <fstream>

#include "catch.hpp"
#include "run_folder/input_error.hpp"

using abs_hil::run_folder::CsvReader;
using abs_hil::run_folder::InputError;

namespace {

constexpr const char* header =
    "time_s,phase,omega1_rad_s,omega2_rad_s,omega1_est_rad_s,omega2_est_rad_s,slip,slip_est,slip_ref,brake_torque_Nm,"
    "brake_torque_ref_Nm,brake_torque_est_Nm,brake_pwm,motor_pwm,motor_enable,theta_N,theta_est_N,distance_m,"
    "slip_velocity_error_m_s";

class File {
 public:
  explicit File(const std::string& text)
      : path_(std::filesystem::temp_directory_path() / ("csv_reader_test_" + std::to_string(::getpid()))) {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~File() { std::filesystem::remove(path_); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string row(const std::string& time, const std::string& phase = "brake") {
  return time + "," + phase + ",1,2,3,4,5,6,7,8,9,10,11,12,1,NaN,14,15,-1.5e-3";
}

std::string error_of(const std::string& text) {
  const File file(text);
  try {
    CsvReader csv(file.path());
    while (csv.next()) {
    }
  } catch (const InputError& error) {
    std::string message = error.what();
    const std::string path = file.path().string();
    const auto at = message.find(path);
    return at == std::string::npos ? message : message.replace(at, path.size(), "FILE");
  }
  return "";
}

}  // namespace

TEST_CASE("Rows are read as they were written, with any line ends and further columns") {
  const File file(std::string(header) + ",extra\r\n" + row("0.25") + ",7\r\n" + row("0.5", "hold") + ",8\r\n");
  CsvReader csv(file.path());
  REQUIRE(csv.next());
  CHECK(csv.time_s() == 0.25);
  CHECK(csv.phase() == "brake");
  CHECK(std::isnan(csv.values()[csv.column("theta_N")]));
  CHECK(csv.values()[csv.column("slip_velocity_error_m_s")] == -1.5e-3);
  CHECK(csv.values()[csv.column("extra")] == 7.0);
  REQUIRE(csv.next());
  CHECK(csv.line() == 3);
  CHECK(csv.phase() == "hold");
  CHECK_FALSE(csv.next());
  CHECK_FALSE(csv.truncated());
}

TEST_CASE("Rows across the reader's blocks") {
  std::string text = std::string(header) + "\n";
  const int count = 60'000;  // some 4 MB
  for (int i = 0; i < count; ++i) text += row(std::to_string(i)) + "\n";
  const File file(text);
  CsvReader csv(file.path());
  int rows = 0;
  bool same = true;
  while (csv.next()) same = same && csv.time_s() == rows++ && csv.values()[2] == 1.0;
  CHECK(same);
  CHECK(rows == count);
}

TEST_CASE("A last line without line end does not count as a row, even if it is complete") {
  for (const std::string& cut : {row("2"), std::string("2,bra"), std::string("2")}) {
    const File file(std::string(header) + "\n" + row("1") + "\n" + cut);
    CsvReader csv(file.path());
    CHECK(csv.next());
    CHECK_FALSE(csv.next());
    CHECK(csv.truncated());
  }
}

TEST_CASE("A file that is not a run is refused with file and line") {
  const std::string h = std::string(header) + "\n";
  CHECK(error_of("") == "FILE:1: the file is empty: the run wrote nothing");
  CHECK(error_of("time_s,pha") ==
        "FILE:1: the file ends within its first line: the recording stopped before the first row");
  CHECK(error_of("time_s,phase\n").find("FILE:1: the header lacks omega1_rad_s, ") == 0);
  CHECK(error_of(h + row("1") + "\n" + row("0.5") + "\n") == "FILE:3: time_s decreases from 1 to 0.5");
  CHECK(error_of(h + row("x") + "\n").find("FILE:2: time_s: \"x\" is not a number") == 0);
  CHECK(error_of(h + row("") + "\n").find("FILE:2: time_s: \"\" is not a number") == 0);
  CHECK(error_of(h + row("NaN") + "\n") == "FILE:2: time_s is not a finite number");
  CHECK(error_of(h + "1,brake,3\n") == "FILE:2: the row has 3 fields instead of 19 and ends before omega2_rad_s");
  CHECK(error_of(h + row("1") + ",9\n") == "FILE:2: the row has more than the header's 19 fields");
  CHECK(error_of(h + "\n") == "FILE:2: time_s: \"\" is not a number (a run writes NaN for an unknown value)");
  CHECK(error_of(std::string(100'000, 'a')).find("FILE:1: the line is longer than any row") == 0);
}
