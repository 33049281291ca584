#include "guardian/guardian_report.hpp"

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
    text += formatted(": no cycle for %.1f ms; the guardian ended it with SIGKILL before it wrote the safe state",
                      static_cast<double>(report.silence_ns) * 1e-6);
  }
  if (report.reason == rig::Reason::safe_state_unverified && report.ended_controller) {
    text += ": the outputs did not read back as zero after it had given them back; the guardian ended it with SIGKILL";
  } else if (report.reason != rig::Reason::controller_silent && report.ended_controller) {
    text += ": the controller did not give the outputs back in time; the guardian ended it with SIGKILL";
  }
  text += '\n';
  if (!report.acted) return text + "the controller had already made the outputs safe: the guardian wrote nothing\n";
  if (report.controller_gone_ns != 0) {
    text += formatted("the controller's process had ended %.3f ms after the guardian noticed\n",
                      ms_between(report.noticed_ns, report.controller_gone_ns));
  } else if (!report.controller_lives) {
    text += "THE CONTROLLER'S PROCESS DID NOT END: it hangs in the kernel\n";
  }
  if (report.verified) {
    text += formatted("drive 0 and brake 0 written and read back %.3f ms after the guardian noticed, at try %d\n",
                      ms_between(report.noticed_ns, report.verified_ns), report.tries);
    return text;
  }
  text += formatted("SAFE STATE NOT VERIFIED after %d tries%s: ", report.tries,
                    report.released ? ", then released by a person" : "");
  text += driver::error_text(report.last_error);
  text += "\nthe board may hold its last duties: press the E-stop (it cuts the drive only) and switch the rig off\n";
  return text;
}

}  // namespace abs_hil::guardian
