#include "program/series_pause.hpp"

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "commands/authority.hpp"
#include "commands/command_listener.hpp"
#include "program/signals.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/lcm_url.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::program {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds look_period{50};

/// Receives commands between two runs.
class StopListener {
 public:
  explicit StopListener(const RunRequest& run)
      : lcm_(run.outputs.lcm_url.value_or(telemetry::default_lcm_url())),
        stream_({.channel_prefix = run.settings.telemetry.channel_prefix}, {}, {}),
        commands_(lcm_, stream_, {}) {
    stream_.add(lcm_);
    const config::CommandOptions& commands = run.settings.commands;
    if (commands.enabled) commands::sign_answers(stream_, commands::read_key(commands.key_file));
    commands_.set_judge([](const command_t& command) {
      const std::string shown = rig::printable(command.command, 64);
      return telemetry::CommandAnswer{rig::Reason::command_not_now,
                                      "refused '" + shown + "': only stop is accepted between two runs of a series"};
    });
    commands_.listen();
  }

  /// @param time_s  time since the pause began
  [[nodiscard]] bool stop_heard(Clock::time_point now, double time_s) {
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

rig::Reason pause_between_runs(const RunRequest& run, double duration_s) {
  std::optional<StopListener> listener;
  if (!run.outputs.no_lcm) listener.emplace(run);
  const auto start = Clock::now();
  while (true) {
    const auto now = Clock::now();
    const double time_s = std::chrono::duration<double>(now - start).count();
    if (signalled() != rig::Reason::none) return signalled();
    if (listener && listener->stop_heard(now, time_s)) return rig::Reason::stop_command;
    if (time_s >= duration_s) return rig::Reason::none;
    std::this_thread::sleep_for(look_period);
  }
}

}  // namespace abs_hil::program
