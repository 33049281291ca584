#include <fmt/format.h>

#include <charconv>

#include "abs_hil/settings/config_error.hpp"
#include "abs_hil/steering/sender.hpp"
#include "abs_hil/telemetry/lcm_url.hpp"
#include "commands.hpp"
#include "exit_status.hpp"

namespace abs_hil::app {

namespace {

double number_of(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) {
    throw settings::ConfigError("send: '" + text + "' is no number");
  }
  return value;
}

steering::Order order_of(const std::vector<std::string>& words) {
  const std::string& command = words.front();
  if ((command == "stop" || command == "start") && words.size() == 1) return {.command = command};
  if (command == "slip-ref" && words.size() == 2) return {.command = command, .value = number_of(words[1])};
  if (command == "gain" && words.size() == 3) {
    return {.command = command, .name = words[1], .value = number_of(words[2])};
  }
  throw settings::ConfigError("send: give one of stop | start | slip-ref X | gain NAME X");
}

}  // namespace

int send(const RunRequest& request, const SendOptions& options) {
  const settings::Settings& s = request.settings;
  const steering::Reply reply =
      steering::send(order_of(options.order), {.url = request.outputs.lcm_url.value_or(telemetry::default_lcm_url()),
                                               .channel_prefix = s.telemetry.channel_prefix,
                                               .key_file = s.commands.key_file,
                                               .timeout_s = options.timeout_s});
  if (reply.outcome == steering::Outcome::accepted) {
    fmt::print("{}\n", reply.message);
    return exit_completed;
  }
  fmt::print(stderr, "abs_hil: {}\n", reply.message);
  return reply.outcome == steering::Outcome::refused ? exit_ended_early : exit_unavailable;
}

}  // namespace abs_hil::app
