#include <cstdio>

#include "program/exit_status.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "telemetry/lcm_url.hpp"
#include "watch/watch_session.hpp"

namespace abs_hil::program {

int watch(const watch::WatchOptions& options) {
  if (!options.url.empty()) {
    static_cast<void>(
        telemetry::parse_lcm_url(options.url));  // a malformed URL is a usage error, not a missing network
  }
  note_signals();
  const watch::WatchEnd end = watch::watch(options, [] { return signalled() != rig::Reason::none; });
  if (end == watch::WatchEnd::nothing_received) {
    fprintf(stderr, "abs_hil: no message arrived within %g s on %sTELEMETRY\n", options.once_timeout_s,
            options.prefix.c_str());
    return exit_unavailable;
  }
  if (end == watch::WatchEnd::quit) return exit_completed;
  return signalled() == rig::Reason::interrupt_signal ? exit_interrupted : exit_terminated;
}

}  // namespace abs_hil::program
