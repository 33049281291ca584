#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>
#include <vector>

#include "abs_hil/rig/record_sink.hpp"

namespace abs_hil::telemetry {

/// The CSV's first line, without the line end. Names and order are a contract; columns may be added at the end.
inline constexpr std::string_view csv_header =
    "time_s,phase,omega1_rad_s,omega2_rad_s,omega1_est_rad_s,omega2_est_rad_s,slip,slip_est,slip_ref,brake_torque_Nm,"
    "brake_torque_ref_Nm,brake_torque_est_Nm,brake_pwm,motor_pwm,motor_enable,theta_N,theta_est_N,distance_m,"
    "slip_velocity_error_m_s";

/// Longest row: 17 doubles of at most 24 characters, their separators, the phase and the flag, with room to spare.
inline constexpr std::size_t csv_row_max_bytes = 640;

/// Writes a row with its line end to `out` and returns its length. Doubles are the shortest text that reads back
/// bit-exactly; NaN is `NaN`. The same on every locale.
std::size_t format_csv_row(const rig::CycleRecord& record, double distance_m, char (&out)[csv_row_max_bytes]) noexcept;

/// One row a cycle into a file, written in blocks of 64 KiB.
class CsvSink : public rig::RecordSink {
 public:
  /// Creates or empties the file. Throws FileError when it cannot be opened.
  explicit CsvSink(std::filesystem::path path);
  /// Writes out what is buffered, if finish() was not called; a failure then goes unseen.
  ~CsvSink() override;

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Throws FileError when any write failed since the start, as on a full disk. Closes the file in any case.
  void finish() override;

  /// True once a write failed: what comes after is not in the file.
  [[nodiscard]] bool failed() const noexcept { return error_number_ != 0; }

 private:
  void append(const char* text, std::size_t size) noexcept;
  void flush() noexcept;
  void close() noexcept;

  std::filesystem::path path_;
  std::vector<char> buffer_;
  std::size_t used_bytes_{0};
  int file_{-1};
  int error_number_{0};  ///< errno of the first write that failed
};

}  // namespace abs_hil::telemetry
