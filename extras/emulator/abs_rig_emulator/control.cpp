// Reads control commands, keeps emulated time, and writes the log of true values, for every board.
#include "control.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "rig/formatted_text.hpp"

namespace abs_hil::program {

void say(const std::string& text) {
  cli::print("{}\n", text);
  std::fflush(stdout);
}

ControlCommand::ControlCommand(std::string_view text) : line(text) {
  std::istringstream in(line);
  for (std::string word; in >> word;) words.push_back(word);
}

double ControlCommand::number(std::size_t n) const {
  const auto value = rig::parse_number<double>(text(n));
  if (!value || !std::isfinite(*value)) throw std::invalid_argument("\"" + text(n) + "\" is not a finite number");
  return *value;
}

bool ControlCommand::first_of(std::size_t n, std::string_view first, std::string_view second) const {
  const std::string& word = text(n);
  if (word == first || word == second) return word == first;
  throw std::invalid_argument(fmt::format("\"{}\": give {} or {}", word, first, second));
}

void take_log(emulator::OutputLog& log, std::int64_t start_ns, OutputFile& changes) {
  for (const emulator::BoardEvent& event : log.take_events()) {
    say(fmt::format("event {:.6f} {}", static_cast<double>(event.time_ns) * 1e-9, event.text));
  }
  for (const auto& [time_ns, now] : log.take_changes()) {
    if (!changes.is_open()) continue;
    changes << fmt::format("{} {:.6f} {:.6f}\n", start_ns + time_ns, now.drive_duty, now.brake_duty) << std::flush;
  }
}

ControlFifo::ControlFifo(const std::string& path) {
  if (path.empty()) return;
  if (::mkfifo(path.c_str(), 0600) != 0 && errno != EEXIST) {
    throw std::runtime_error(path + ": cannot create the FIFO: " + rig::refusal(errno, path, rig::writing));
  }
  // Open it for writing, too: otherwise it reports end of file whenever it has no writer.
  fifo_ = driver::FileDescriptor(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (fifo_.get() < 0)
    throw std::runtime_error(path + ": cannot open the FIFO: " + rig::refusal(errno, path, rig::writing));
}

void ControlFifo::take(EmulatedBoard& board) {
  std::array<char, 512> buffer{};
  const ssize_t got = ::read(fifo_.get(), buffer.data(), buffer.size());
  if (got > 0) pending_.append(buffer.data(), static_cast<std::size_t>(got));
  for (std::size_t end = pending_.find('\n'); end != std::string::npos; end = pending_.find('\n')) {
    const std::string line = pending_.substr(0, end);
    pending_.erase(0, end + 1);
    try {
      say(line + ": " + board.obey(line));
    } catch (const std::exception& error) {
      say(line + ": error: " + error.what());
    }
  }
}

void OutputFile::begin(const std::string& file) {
  end();
  if (file == "off") return;
  open(name_ = file);
  if (!is_open()) throw std::runtime_error("cannot write \"" + file + "\": " + rig::refusal(errno, file, rig::writing));
}

void OutputFile::end() {
  if (!is_open()) return;
  close();
  if (good()) return;
  any_lost_ = true;
  cli::print(stderr, "abs_rig_emulator: \"{}\" is incomplete: a write failed; is the disk full?\n", name_);
  clear();
}

BoardTime::BoardTime(const EmulatorOptions& options, bool with_trip_flags) : lock_step_(options.board.lock_step) {
  restart();
  if (options.truth_file.empty()) return;
  stream_.begin(options.truth_file);
  stream_ << "time_s,omega1_rad_s,omega2_rad_s,slip,brake_torque_Nm,theta_N,drive_duty,brake_duty"
          << (with_trip_flags ? ",trip_flags\n" : "\n");
}

void BoardTime::write(std::int64_t time_ns, const rig::PlantTruth& truth, const emulator::Outputs& out) {
  stream_ << fmt::format("{:.6f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.6f},{:.6f}", static_cast<double>(time_ns) * 1e-9,
                         truth.speeds.omega1_rad_s, truth.speeds.omega2_rad_s, truth.slip, truth.brake_torque_Nm,
                         truth.theta_N, out.drive_duty, out.brake_duty);
}

std::string state_text(const emulator::RigBehind& rig, int digits_of_time) {
  const emulator::Outputs out = rig.outputs();
  const auto& state = rig.plant().state();
  return fmt::format("time {:.{}f} s, drive {:.4f}, brake {:.4f}, upper {:.2f} rad/s, lower {:.2f} rad/s",
                     static_cast<double>(rig.time_ns()) * 1e-9, digits_of_time, out.drive_duty, out.brake_duty,
                     state.omega1_rad_s, state.omega2_rad_s);
}

}  // namespace abs_hil::program
