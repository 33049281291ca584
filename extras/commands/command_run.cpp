// The extra "commands" in the program: over LCM in a run, between two runs of a series, and `abs_hil send`.
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <optional>

#include "commands/authority.hpp"
#include "commands/command_listener.hpp"
#include "commands/remote_commands.hpp"
#include "commands/sender.hpp"
#include "config/config_error.hpp"
#include "program/extra.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::commands {

namespace {

/// The commands of one run.
class CommandRun final : public program::RunPart {
 public:
  void attach(run::Run& run) override { run_ = &run; }

  void open(telemetry::LcmOutlet& lcm, telemetry::MessageStream& stream) override {
    stream_ = &stream;
    if (run_->real_time()) commands_.emplace(run_->settings(), stream, run_->names());
    // This runs in the listening thread: the next cycle sees the request.
    listener_.emplace(lcm, stream, [this] { run_->request_stop(rig::Reason::stop_command); });
  }

  rig::RecordSink* sink() override { return commands_ ? &*commands_ : nullptr; }

  void listen() override {
    if (!commands_) return;
    commands_->set_mailbox(run_->adjustments());
    commands_->set_listener(*listener_);
    listener_->set_judge([this](const command_t& command) { return commands_->judge(command); });
    listener_->listen();
    stream_->set_before_end([this] {
      listener_->finish();
      commands_->refuse_pending();
    });
  }

  void poll() override {
    if (listener_) listener_->poll();
  }

  [[nodiscard]] bool stop_requested() const override { return listener_ && listener_->stop_requested(); }

 private:
  run::Run* run_{nullptr};
  telemetry::MessageStream* stream_{nullptr};
  std::optional<RemoteCommands> commands_;
  std::optional<CommandListener> listener_;
};

/// Receives commands between two runs.
class StopListener {
 public:
  explicit StopListener(const program::RunRequest& run)
      : lcm_(run.outputs.lcm_url.value_or(telemetry::default_lcm_url())),
        stream_({.channel_prefix = run.settings.telemetry.channel_prefix}, {}, {}),
        commands_(lcm_, stream_, {}) {
    stream_.add(lcm_);
    if (run.settings.commands.enabled) sign_answers(stream_, read_key(run.settings.commands.key_file));
    commands_.set_judge([](const command_t& command) {
      const std::string shown = rig::clean_text(command.command, 64);
      return CommandAnswer{rig::Reason::command_not_now,
                           "refused '" + shown + "': only stop is accepted between two runs of a series"};
    });
    commands_.listen();
  }

  [[nodiscard]] bool stop_heard(std::chrono::steady_clock::time_point now, double time_s) {
    stream_.pass_time(std::chrono::nanoseconds(now.time_since_epoch()).count(), time_s);
    if (!commands_.stop_requested()) {
      commands_.poll();
      return false;
    }
    commands_.finish();
    return true;
  }

 private:
  telemetry::LcmOutlet lcm_;
  telemetry::MessageStream stream_;
  CommandListener commands_;
};

program::StopHeard heard_in_pause(const program::RunRequest& request) {
  return [listener = std::make_shared<StopListener>(request)](
             std::chrono::steady_clock::time_point now, double time_s) { return listener->stop_heard(now, time_s); };
}

// ---- `abs_hil send`: a command to a running abs_hil, and its answer

double number_of(const std::string& text) {
  if (const auto value = rig::parse_number<double>(text)) return *value;
  throw config::ConfigError("send: '" + text + "' is not a number; give a decimal number");
}

Order order_of(const std::vector<std::string>& words) {
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

int send_typed(const SendOptions& options) {
  const config::Settings s = config::merged_settings(options.sources);
  const Reply reply =
      commands::send(order_of(options.order), {.url = options.lcm_url.value_or(telemetry::default_lcm_url()),
                                               .channel_prefix = s.telemetry.channel_prefix,
                                               .key_file = s.commands.key_file,
                                               .timeout_s = options.timeout_s});
  if (reply.outcome == Outcome::accepted) {
    cli::print("{}\n", reply.message);
    if (!reply.authentic) {
      spdlog::warn(
          "this answer is not authenticated: anybody on the network could have sent it; give the run and send the "
          "same key with --set commands.key_file=FILE, or look at the rig");
    }
    return reply.authentic ? program::exit_completed : program::exit_ended_early;
  }
  cli::print(stderr, "abs_hil: {}\n", reply.message);
  return reply.outcome == Outcome::refused ? program::exit_ended_early : program::exit_unavailable;
}

program::Action add_send(cli::Parser& parser, const program::Words&) {
  const auto o = std::make_shared<SendOptions>();
  parser.add("order", &o->order, "stop | start | continue | slip-ref X | gain NAME X",
             {.count = {1, 3}, .required = true});
  parser.add("--config", &o->sources.config_file, "TOML file with commands.key_file", {.type = "FILE"});
  program::add_assignments(parser, o->sources);
  parser.add("--lcm-url", &o->lcm_url, "LCM network");
  parser.add("--timeout", &o->timeout_s, "longest wait for the answer, s",
             {.type = "S", .range = {0.1, 60.0}, .show_default = true});
  return [o] { return send_typed(*o); };
}

constexpr program::Subcommand send_row{"send", "send a command to a running abs_hil over LCM", &add_send};

}  // namespace

}  // namespace abs_hil::commands

namespace abs_hil::program {

extern const Extra commands_extra;
constinit const Extra commands_extra{
    .name = "commands",
    .subcommands = {&commands::send_row, 1},
    .join = [](const RunRequest&) -> std::unique_ptr<RunPart> { return std::make_unique<commands::CommandRun>(); },
    .pause = &commands::heard_in_pause};

}  // namespace abs_hil::program
