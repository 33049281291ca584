#include "guardian/guardian_loop.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

using rig::formatted;

double ms_between(std::int64_t from_ns, std::int64_t to_ns) { return static_cast<double>(to_ns - from_ns) * 1e-6; }

}  // namespace

std::string to_text(const GuardianReport& report, int controller) {
  std::string text(rig::description(report.reason));
  text += formatted(" (reason %d, process %d)", static_cast<int>(report.reason), controller);
  if (report.reason == rig::Reason::controller_silent) {
    text += formatted(": no cycle for %.1f ms; ended it with SIGKILL before writing",
                      static_cast<double>(report.silence_ns) * 1e-6);
  }
  text += '\n';
  if (!report.acted) return text + "its outputs had been released before: nothing to write\n";
  if (report.controller_gone_ns != 0) {
    text += formatted("process seen to have ended %.3f ms after this was noticed\n",
                      ms_between(report.noticed_ns, report.controller_gone_ns));
  } else if (report.reason != rig::Reason::safe_state_unverified) {
    text += "PROCESS NOT SEEN TO END: it hangs in the kernel\n";
  }
  if (report.verified) {
    text += formatted("drive 0 and brake 0 written and read back %.3f ms after this was noticed, at try %d\n",
                      ms_between(report.noticed_ns, report.verified_ns), report.tries);
    return text;
  }
  text += formatted("SAFE STATE NOT VERIFIED after %d tries: ", report.tries);
  text += driver::error_text(report.last_error);
  text += "\nthe board may hold its last duties: press the E-stop (it cuts the drive only) and switch the rig off\n";
  return text;
}

}  // namespace abs_hil::guardian
