// `abs_hil send`: a command to a running abs_hil, and its answer.
#include <spdlog/spdlog.h>

#include <memory>

#include "commands/sender.hpp"
#include "config/config_error.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::program {

namespace {

double number_of(const std::string& text) {
  if (const auto value = rig::parse_number<double>(text)) return *value;
  throw config::ConfigError("send: '" + text + "' is not a number; give a decimal number");
}

commands::Order order_of(const std::vector<std::string>& words) {
  const std::string& command = words.front();
  if ((command == "stop" || command == "start" || command == "continue") && words.size() == 1)
    return {.command = command};
  if (command == "slip-ref" && words.size() == 2) return {.command = command, .value = number_of(words[1])};
  if (command == "gain" && words.size() == 3) {
    return {.command = command, .name = words[1], .value = number_of(words[2])};
  }
  throw config::ConfigError("send: give one of stop | start | continue | slip-ref X | gain NAME X");
}

struct SendOptions {
  config::Sources sources{};
  std::optional<std::string> lcm_url{};
  std::vector<std::string> order{};  ///< "stop", "start", "continue", "slip-ref X", "gain NAME X"
  double timeout_s{3.0};
};

int send(const SendOptions& options) {
  const config::Settings s = config::merged_settings(options.sources);
  const commands::Reply reply =
      commands::send(order_of(options.order), {.url = options.lcm_url.value_or(telemetry::default_lcm_url()),
                                               .channel_prefix = s.telemetry.channel_prefix,
                                               .key_file = s.commands.key_file,
                                               .timeout_s = options.timeout_s});
  if (reply.outcome == commands::Outcome::accepted) {
    cli::print("{}\n", reply.message);
    if (!reply.authentic) {
      spdlog::warn(
          "this answer is not authenticated: anybody on the network could have sent it; give the run and send the "
          "same key with --set commands.key_file=FILE, or look at the rig");
    }
    return reply.authentic ? exit_completed : exit_ended_early;
  }
  cli::print(stderr, "abs_hil: {}\n", reply.message);
  return reply.outcome == commands::Outcome::refused ? exit_ended_early : exit_unavailable;
}

Action add_send(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<SendOptions>();
  parser.add("order", &o->order, "stop | start | continue | slip-ref X | gain NAME X",
             {.count = {1, 3}, .required = true});
  parser.add("--config", &o->sources.config_file, "TOML file with commands.key_file", {.type = "FILE"});
  add_assignments(parser, o->sources);
  parser.add("--lcm-url", &o->lcm_url, "LCM network");
  parser.add("--timeout", &o->timeout_s, "longest wait for the answer, s",
             {.type = "S", .range = {0.1, 60.0}, .show_default = true});
  return [o] { return send(*o); };
}

}  // namespace

extern const Subcommand send_row;
constinit const Subcommand send_row{"send", "send a command to a running abs_hil over LCM", &add_send};

}  // namespace abs_hil::program
