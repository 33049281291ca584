#include "program/live_commands.hpp"

#include "program/run_arguments.hpp"

namespace abs_hil::program {

void add_commission(cli::Parser& parser, CommissionCommand& command) {
  command.parser = parser.add_subcommand("commission", "first steps with a real rig; asks before each step");
  add_configuration_options(command.parser, command.options);
  command.parser.add({.names = "--drive-duty",
                      .to = &command.pulses.drive_duty,
                      .help = "duty of the drive pulse, in (0, 0.3]",
                      .show_default = true});
  command.parser.add({.names = "--brake-duty",
                      .to = &command.pulses.brake_duty,
                      .help = "duty of the brake pulse, in (0, 0.7]",
                      .show_default = true});
}

cli::Parser add_watch(cli::Parser& parser, watch::WatchOptions& o) {
  cli::Parser watch = parser.add_subcommand("watch", "show a running experiment in this terminal, over LCM; q quits");
  watch.add({.names = "--lcm-url", .to = &o.url, .help = "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)"});
  watch.add({.names = "--prefix",
             .to = &o.prefix,
             .help = "prefix of the channel names: the run's telemetry.channel_prefix",
             .show_default = true});
  watch.add({.names = "--window",
             .to = &o.window_s,
             .help = "width of the plots, 1 to 60 s",
             .type = "S",
             .show_default = true});
  watch.add({.names = "--ascii", .to = &o.ascii, .help = "use ASCII only, for a terminal that shows braille badly"});
  watch.add({.names = "--plain",
             .to = &o.plain,
             .help = "print one line per second instead of a screen; always so without a terminal"});
  watch.add({.names = "--once",
             .to = &o.once,
             .help = "print one screen as text; exit status 3 if no message arrives",
             .excludes = {"--plain"}});
  watch.add({.names = "--timeout",
             .to = &o.once_timeout_s,
             .help = "longest wait of --once for messages, s",
             .type = "S",
             .show_default = true,
             .needs = {"--once"}});
  return watch;
}

void add_send(cli::Parser& parser, SendCommand& command) {
  command.parser = parser.add_subcommand("send", "send a command to a running abs_hil over LCM");
  command.parser.add({.names = "order",
                      .to = &command.send.order,
                      .help = "stop | start | continue | slip-ref X | gain NAME X",
                      .count = {1, 3},
                      .required = true});
  command.parser.add({.names = "--config",
                      .to = &command.options.config_file,
                      .help = "TOML file with commands.key_file",
                      .type = "FILE"});
  command.parser.add({.names = "--set",
                      .to = &command.options.assignments,
                      .help = "set any configuration value",
                      .type = "key=value",
                      .repeated = true});
  command.parser.add({.names = "--lcm-url", .to = &command.options.outputs.lcm_url, .help = "LCM network"});
  command.parser.add({.names = "--timeout",
                      .to = &command.send.timeout_s,
                      .help = "longest wait for the answer, s",
                      .type = "S",
                      .range = {0.1, 60.0},
                      .show_default = true});
}

}  // namespace abs_hil::program
