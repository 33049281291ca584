// The board of examples/own_backend with the simulated rig behind it, on a pty. It knows the text protocol and nothing
// of the driver.
//
// usage: board_on_pty LINK WATCHDOG_MS
// LINK becomes a link to the pty. The board ends its outputs WATCHDOG_MS after the last command; 0: it holds them.
// Prints a line "widths DRIVE BRAKE at MILLISECONDS" whenever they change. Lines on stdin: "turn upper" and "turn
// lower" turn a wheel once.

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>

#include "abs_hil/plant_sim/plant.hpp"

namespace {

using abs_hil::plant_sim::Plant;
using abs_hil::plant_sim::PlantState;

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

/// From standstill the plant is stiff: a computer with other work could not keep up with it.
abs_hil::plant_sim::PlantOptions cheap() {
  abs_hil::plant_sim::PlantOptions options;
  options.slip_regularisation_m_s = 0.1;
  return options;
}

class Board {
 public:
  Board(int line, std::int64_t watchdog_ns) : line_(line), watchdog_ns_(watchdog_ns) {}

  /// Brings the rig to the present.
  void catch_up() {
    constexpr std::int64_t step_ns = 500'000;
    for (const std::int64_t now = now_ns(); time_ns_ + step_ns <= now; time_ns_ += step_ns) {
      if (watchdog_ns_ > 0 && time_ns_ - commanded_ns_ > watchdog_ns_) set(0, 0);
      plant_.advance(static_cast<double>(step_ns) * 1e-9, {.motor_duty = drive_ / 255.0, .brake_duty = brake_ / 255.0});
    }
  }
  void take(const std::string& text) {
    for (const char c : text) {
      if (c != '\n') {
        word_ += c;
        continue;
      }
      obey();
      word_.clear();
    }
  }
  void turn(bool upper) {
    PlantState state = plant_.state();
    (upper ? state.angle1_rad : state.angle2_rad) += 2.0 * std::numbers::pi;
    plant_.reset(state);
  }

 private:
  void obey() {
    unsigned int drive = 0;
    unsigned int brake = 0;
    if (word_ == "?") return answer("abs-serial 3 A-17\n");
    if (std::sscanf(word_.c_str(), "w %u %u", &drive, &brake) == 2 && drive <= 255 && brake <= 255) {
      commanded_ns_ = time_ns_;
      set(drive, brake);
    } else if (word_ != "r") {
      return;  // a line that is none gets no answer
    }
    const PlantState& s = plant_.state();
    const auto counts = [](double angle_rad) {
      return static_cast<int>(std::floor(angle_rad / (2.0 * std::numbers::pi) * 4096.0));
    };
    answer("s " + std::to_string(counts(s.angle1_rad)) + ' ' + std::to_string(counts(s.angle2_rad)) + ' ' +
           std::to_string(drive_) + ' ' + std::to_string(brake_) + '\n');
  }
  void answer(const std::string& text) const { static_cast<void>(!::write(line_, text.data(), text.size())); }
  void set(unsigned int drive, unsigned int brake) {
    if (drive == drive_ && brake == brake_) return;
    drive_ = drive;
    brake_ = brake;
    std::printf("widths %u %u at %.1f\n", drive, brake, static_cast<double>(now_ns()) * 1e-6);
    std::fflush(stdout);
  }

  int line_;
  std::int64_t watchdog_ns_;
  Plant plant_{cheap()};
  std::int64_t time_ns_{now_ns()};
  std::int64_t commanded_ns_{time_ns_};
  std::string word_{};
  unsigned int drive_{0};
  unsigned int brake_{0};
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const int line = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
  if (line < 0 || ::grantpt(line) != 0 || ::unlockpt(line) != 0) return 1;
  const char* name = ::ptsname(line);
  if (::symlink(name, argv[1]) != 0) return 1;
  Board board(line, std::strtol(argv[2], nullptr, 10) * 1'000'000L);
  std::printf("ready\n");
  std::fflush(stdout);
  std::string text(256, '\0');
  for (;;) {
    pollfd waiting[]{{line, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    ::poll(waiting, 2, 1);
    board.catch_up();
    if ((waiting[0].revents & (POLLIN | POLLHUP)) == POLLHUP) ::usleep(1000);  // nobody has the line open
    if ((waiting[0].revents & POLLIN) != 0) {
      const ssize_t got = ::read(line, text.data(), text.size());
      if (got > 0) board.take(text.substr(0, static_cast<std::size_t>(got)));
    }
    if ((waiting[1].revents & (POLLIN | POLLHUP)) != 0) {
      const ssize_t got = ::read(STDIN_FILENO, text.data(), text.size());
      if (got <= 0) return 0;
      board.turn(text.starts_with("turn upper"));
    }
  }
}
