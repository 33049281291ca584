#include "truth_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace abs_hil::program {

void open_for_writing(std::ofstream& stream, const std::string& file) {
  stream.close();
  stream.open(file);
  if (!stream) throw std::runtime_error("cannot write \"" + file + "\": " + std::strerror(errno));
}

TruthFile::TruthFile(const std::string& file, bool with_trip_flags) {
  if (file.empty()) return;
  open_for_writing(stream_, file);
  stream_ << "time_s,omega1_rad_s,omega2_rad_s,slip,brake_torque_Nm,theta_N,drive_duty,brake_duty"
          << (with_trip_flags ? ",trip_flags\n" : "\n");
}

void TruthFile::write(std::int64_t time_ns, const rig::PlantTruth& truth, const emulator::Outputs& out) {
  stream_ << fmt::format("{:.6f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.6f},{:.6f}", static_cast<double>(time_ns) * 1e-9,
                         truth.speeds.omega1_rad_s, truth.speeds.omega2_rad_s, truth.slip, truth.brake_torque_Nm,
                         truth.theta_N, out.drive_duty, out.brake_duty);
}

}  // namespace abs_hil::program
