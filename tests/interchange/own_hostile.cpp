// abs_hil with controllers of its own that end or hold up the program, as a project outside this tree might build it.

#include <unistd.h>

#include <cstdlib>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/program/program.hpp"

namespace {

using namespace abs_hil;

/// An object that the run makes: another run still uses it when exit() is called.
struct SharedByRuns {
  ~SharedByRuns() { static_cast<void>(!::write(STDERR_FILENO, "destroyed\n", 10)); }
};

void exits() {
  static const SharedByRuns shared;
  std::exit(0);
}
void exits_at_once() { ::_exit(0); }
void exits_quickly() { std::quick_exit(0); }
void execs() { static_cast<void>(::execl("/bin/true", "true", nullptr)); }
/// Its child ends at once. The run goes on.
void forks() {
  static bool done = false;
  if (!std::exchange(done, true) && ::fork() == 0) ::_exit(0);
}
void forks_and_exits() {
  static bool done = false;
  if (!std::exchange(done, true) && ::fork() == 0) std::exit(0);
}
void loops() {
  for (volatile bool for_ever = true; for_ever;) {
  }
}
void is_slow() { static_cast<void>(::usleep(1'000'000)); }

/// Does its deed in every step from the hundredth on.
template <void (*deed)()>
class Hostile final : public control::SlipController {
 public:
  explicit Hostile(const control::ControllerContext& /*context*/) {}
  void reset(const control::SlipInput& /*input*/) noexcept override {}
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& /*input*/) noexcept override {
    constexpr int first = 100;
    if (++steps_ >= first) deed();
    return {.brake_torque_Nm = 1.0, .slip_velocity_error_m_s = 0.0, .theta_est_N = rig::unknown};
  }

 private:
  int steps_{0};
};

constexpr control::ControllerEntry own[]{
    control::controller_entry<Hostile<exits>>("exits", "calls exit"),
    control::controller_entry<Hostile<exits_at_once>>("exits-at-once", "calls _exit"),
    control::controller_entry<Hostile<exits_quickly>>("exits-quickly", "calls quick_exit"),
    control::controller_entry<Hostile<execs>>("execs", "becomes another program"),
    control::controller_entry<Hostile<forks>>("forks", "has a child that calls _exit"),
    control::controller_entry<Hostile<forks_and_exits>>("forks-and-exits", "has a child that calls exit"),
    control::controller_entry<Hostile<loops>>("loops", "does not return"),
    control::controller_entry<Hostile<is_slow>>("slow", "takes a second"),
};

}  // namespace

int main(int argc, char** argv) { return abs_hil::program::run_program(argc, argv, own); }
