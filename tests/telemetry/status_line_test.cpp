// The status line in a terminal.
#include "telemetry/status_line.hpp"

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <string>

#include "catch.hpp"
#include "telemetry/sample_records.hpp"

namespace abs_hil::telemetry {
namespace {

/// Both ends of a pseudo-terminal: the line is written to `terminal`.
struct Terminal {
  int screen{::posix_openpt(O_RDWR | O_NOCTTY)};
  int terminal{-1};
  Terminal() {
    REQUIRE(screen >= 0);
    REQUIRE(::grantpt(screen) == 0);
    REQUIRE(::unlockpt(screen) == 0);
    terminal = ::open(::ptsname(screen), O_RDWR | O_NOCTTY);
    REQUIRE(terminal >= 0);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal() {
    ::close(terminal);
    ::close(screen);
  }
  std::string shown() const {
    std::string text;
    pollfd ready{screen, POLLIN, 0};
    char buffer[4096];
    while (::poll(&ready, 1, 0) > 0) {
      const ssize_t n = ::read(screen, buffer, sizeof buffer);
      if (n <= 0) break;
      text.append(buffer, static_cast<std::size_t>(n));
    }
    return text;
  }
};

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST_CASE("the line shows phase, speeds, slip, estimate, overruns and drops") {
  rig::CycleRecord r = test::sample_record(0);
  r.truth.speeds = {123.44, 150.0};
  r.truth.slip = 0.18;
  r.control.theta_est_N = 22.876;
  StatusSnapshot status;
  status.timing.overruns.total = 3;
  status.telemetry_drops = 4;
  status.gate_interventions = 5;
  CHECK(format_status_line(r, status) ==
        "brake      ω1  123.4  ω2  150.0 rad/s  slip  0.18  θ̂  22.88 N  overruns 3  drops 4  gate 5");
}

TEST_CASE("an unknown number is a dash, a huge one does no harm") {
  rig::CycleRecord r = test::sample_record(0);
  r.truth.speeds = {1e300, 150.0};
  r.truth.slip = 0.18;
  r.control.theta_est_N = rig::unknown;
  const std::string line = format_status_line(r, {});
  CHECK_THAT(line, Catch::Matchers::Contains("ω2  150.0 rad/s  slip  0.18  θ̂      - N  overruns 0"));
  CHECK(format_status_line(r, {}, 80).empty());  // the first field alone is too long
}

TEST_CASE("the line ends at a whole field, and columns are not bytes") {
  rig::CycleRecord r = test::sample_record(0);
  r.truth.speeds = {123.44, 150.0};
  r.truth.slip = 0.18;
  r.control.theta_est_N = 22.876;
  const std::string up_to_slip = "brake      ω1  123.4  ω2  150.0 rad/s  slip  0.18";
  const std::string up_to_theta = up_to_slip + "  θ̂  22.88 N";
  const std::string up_to_overruns = up_to_theta + "  overruns 0";
  CHECK(format_status_line(r, {}, 73) == up_to_overruns);
  CHECK(format_status_line(r, {}, 72) == up_to_theta);
  CHECK(format_status_line(r, {}, 61) == up_to_theta);
  CHECK(format_status_line(r, {}, 60) == up_to_slip);
  CHECK(format_status_line(r, {}, 0).empty());
}

TEST_CASE("on a terminal of 80 columns the line is no field shorter than it has to be, and none is cut") {
  const Terminal pty;
  const winsize size{.ws_row = 24, .ws_col = 80, .ws_xpixel = 0, .ws_ypixel = 0};
  REQUIRE(::ioctl(pty.terminal, TIOCSWINSZ, &size) == 0);
  StatusLine line({}, pty.terminal);
  rig::CycleRecord r = test::sample_record(0);
  r.control.theta_est_N = rig::unknown;
  line.consume(r, 0.0);
  const std::string shown = pty.shown();
  CHECK_THAT(shown, Catch::Matchers::EndsWith(format_status_line(r, {}, 79)));
  CHECK_THAT(shown, Catch::Matchers::EndsWith(" N  overruns 0"));
  CHECK_THAT(shown, !Catch::Matchers::Contains("nan"));
}

TEST_CASE("a terminal shows the line at most ten times a second and nothing after the end") {
  const Terminal pty;
  StatusLine line({}, pty.terminal);
  REQUIRE(line.active());
  for (std::uint64_t i = 0; i < 1000; ++i) line.consume(test::sample_record(i), 0.0);  // one second at 1 kHz
  line.finish();
  const std::string shown = pty.shown();
  CHECK(count_of(shown, "brake") == 10);
  CHECK(shown.ends_with("\r\x1b[K"));
}

TEST_CASE("a held terminal is skipped, not waited for") {
  const Terminal pty;
  StatusLine line({}, pty.terminal);
  REQUIRE(::tcflow(pty.terminal, TCOOFF) == 0);
  for (std::uint64_t i = 0; i < 300; ++i) line.consume(test::sample_record(i), 0.0);
  CHECK(pty.shown().empty());
  REQUIRE(::tcflow(pty.terminal, TCOON) == 0);
}

TEST_CASE("a file that is not a terminal stays unchanged") {
  int ends[2];
  REQUIRE(::pipe(ends) == 0);
  {
    StatusLine line({}, ends[1]);
    CHECK_FALSE(line.active());
    line.consume(test::sample_record(0), 0.0);
    line.finish();
  }
  pollfd ready{ends[0], POLLIN, 0};
  CHECK(::poll(&ready, 1, 0) == 0);
  ::close(ends[0]);
  ::close(ends[1]);
}

}  // namespace
}  // namespace abs_hil::telemetry
