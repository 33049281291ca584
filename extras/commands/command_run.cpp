// The extra "commands" in the program: commands over LCM during a run and between two runs of a series.
#include <chrono>
#include <memory>
#include <optional>

#include "commands/authority.hpp"
#include "commands/command_listener.hpp"
#include "commands/remote_commands.hpp"
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
  std::optional<telemetry::CommandListener> listener_;
};

/// Receives commands between two runs.
class StopListener final : public program::PauseListener {
 public:
  explicit StopListener(const program::RunRequest& run)
      : lcm_(run.outputs.lcm_url.value_or(telemetry::default_lcm_url())),
        stream_({.channel_prefix = run.settings.telemetry.channel_prefix}, {}, {}),
        commands_(lcm_, stream_, {}) {
    stream_.add(lcm_);
    const config::CommandOptions& commands = run.settings.commands;
    if (commands.enabled) sign_answers(stream_, read_key(commands.key_file));
    commands_.set_judge([](const command_t& command) {
      const std::string shown = rig::clean_text(command.command, 64);
      return telemetry::CommandAnswer{rig::Reason::command_not_now,
                                      "refused '" + shown + "': only stop is accepted between two runs of a series"};
    });
    commands_.listen();
  }

  [[nodiscard]] bool stop_heard(std::chrono::steady_clock::time_point now, double time_s) override {
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
  telemetry::CommandListener commands_;
};

}  // namespace

}  // namespace abs_hil::commands

namespace abs_hil::program {

extern const Subcommand send_row;  // send.cpp
extern const Extra commands_extra;
constinit const Extra commands_extra{
    .name = "commands",
    .subcommands = {&send_row, 1},
    .join = [](const RunRequest&) -> std::unique_ptr<RunPart> { return std::make_unique<commands::CommandRun>(); },
    .pause = [](const RunRequest& request) -> std::unique_ptr<PauseListener> {
      return std::make_unique<commands::StopListener>(request);
    }};

}  // namespace abs_hil::program
