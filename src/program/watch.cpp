// `abs_hil watch`: a running experiment in this terminal.
#include <cstdio>
#include <memory>

#include "program/exit_status.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "telemetry/lcm_url.hpp"
#include "watch/watch_session.hpp"

namespace abs_hil::program {

namespace {

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

}  // namespace

Action add_watch(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<watch::WatchOptions>();
  parser.add(
      {.names = "--lcm-url", .to = &o->url, .help = "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)"});
  parser.add({.names = "--prefix",
              .to = &o->prefix,
              .help = "prefix of the channel names: the run's telemetry.channel_prefix",
              .show_default = true});
  parser.add({.names = "--window",
              .to = &o->window_s,
              .help = "width of the plots, 1 to 60 s",
              .type = "S",
              .show_default = true});
  parser.add({.names = "--ascii", .to = &o->ascii, .help = "use ASCII only, for a terminal that shows braille badly"});
  parser.add({.names = "--plain",
              .to = &o->plain,
              .help = "print one line per second instead of a screen; always so without a terminal"});
  parser.add({.names = "--once",
              .to = &o->once,
              .help = "print one screen as text; exit status 3 if no message arrives",
              .excludes = {"--plain"}});
  parser.add({.names = "--timeout",
              .to = &o->once_timeout_s,
              .help = "longest wait of --once for messages, s",
              .type = "S",
              .show_default = true,
              .needs = {"--once"}});
  return [o] { return watch(*o); };
}

}  // namespace abs_hil::program
