// Carries out accepted commands and answers when a cycle shows their effect.
#include "commands/remote_commands.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "config/config_error.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::commands {

namespace {

constexpr double state_period_s = 0.5;
constexpr std::size_t shown_max_characters = 64;
constexpr std::string_view start_name = "start";
constexpr std::string_view continue_name = "continue";

/// A change in words.
std::string change_text(const std::string& key, double value) {
  return key == start_name || key == continue_name ? key : fmt::format("{} = {}", key, value);
}

std::string shown(const std::string& text) { return rig::clean_text(text, shown_max_characters); }

std::string why(rig::Reason reason) {
  switch (reason) {
    case rig::Reason::command_not_authentic:
      return "its mac does not fit: the sender used another key, or somebody changed the message";
    case rig::Reason::command_repeated: return "it belongs to another session, or its sequence number was used before";
    default: return std::string(rig::description(reason));
  }
}

}  // namespace

RemoteCommands::RemoteCommands(const config::Settings& settings, telemetry::MessageStream& stream, rig::RunNames names)
    : stream_(stream),
      live_(settings),
      names_(std::move(names)),
      waiting_(settings.experiment.wait_for_start),
      by_person_(settings.experiment.answers == "person") {
  if (!settings.commands.enabled) return;
  const std::string key = read_key(settings.commands.key_file);
  authority_.emplace(key);
  sign_answers(stream_, key);
}

std::optional<CommandAnswer> RemoteCommands::judge(const command_t& command) {
  const std::string refused = "refused '" + shown(command.command) + "': ";
  if (!authority_) {
    return CommandAnswer{rig::Reason::commands_not_enabled,
                         refused +
                             "only 'stop' is accepted; start the run with --set commands.enabled=true "
                             "--set commands.key_file=FILE, and make FILE before by (umask 077; "
                             "openssl rand -hex 32 > FILE)"};
  }
  if (const rig::Reason reason = authority_->judge(command); reason != rig::Reason::none) {
    return CommandAnswer{reason, refused + why(reason)};
  }
  bool taken = false;
  CommandAnswer answer = carry_out(command, taken);
  if (taken) return std::nullopt;
  answer.authentic = true;
  answer.message = refused + answer.message;
  return answer;
}

CommandAnswer RemoteCommands::carry_out(const command_t& command, bool& taken) {
  using rig::Reason;
  if (mailbox_ == nullptr) return {Reason::command_not_now, "the run has not begun yet"};
  if (over_) return {Reason::command_not_now, "the run has ended"};
  experiment::Adjustment adjustment;
  config::LiveSettings changed = live_;
  Pending pending{.key = {}, .value = command.value, .sender = command.sender};
  if (command.command == "start") {
    if (!waiting_) return {Reason::command_not_now, "the run does not wait for a start command (--wait-for-start)"};
    pending.key = start_name;
    pending.value = 0.0;
  } else if (command.command == continue_name) {
    if (!asking_) return {Reason::command_not_now, "the present phase asks nothing"};
    adjustment.kind = experiment::Adjustment::Kind::answer;
    pending.key = continue_name;
    pending.value = 0.0;
  } else if (command.command == "slip-ref" || command.command == "gain") {
    try {
      pending.key = changed.resolve(command.command == "gain" ? shown(command.name) : "control.slip_ref");
      adjustment = changed.set(pending.key, command.value);
    } catch (const config::ConfigError& error) {
      return {Reason::command_out_of_range, error.what()};
    }
  } else {
    return {Reason::command_unknown, "unknown command; give slip-ref, gain, start, continue or stop"};
  }
  const std::uint32_t number = mailbox_->put(std::move(adjustment));
  if (number == 0) return {Reason::command_not_now, "too many changes at once: send it again"};
  if (pending.key == start_name) waiting_ = false;
  if (pending.key == continue_name) asking_ = false;
  live_ = std::move(changed);
  pending_.emplace(number, std::move(pending));
  taken = true;
  return {};
}

void RemoteCommands::settle(rig::Reason reason, std::map<std::uint32_t, Pending>::iterator pending) {
  const Pending& done = pending->second;
  ++accepted_;
  // The stream tells of every answer itself, also of one at the terminal.
  if (done.key != continue_name) stream_.send_adjustment(done.key, done.value);
  stream_.answer_command(
      reason, fmt::format("accepted: {} (sender '{}')", change_text(done.key, done.value), shown(done.sender)),
      done.value);
  pending_.erase(pending);
}

void RemoteCommands::settle_named(rig::Reason reason, std::string_view name) {
  for (auto it = pending_.begin(); it != pending_.end(); ++it) {
    if (it->second.key != name) continue;
    settle(reason, it);
    return;
  }
}

void RemoteCommands::refuse_pending() {
  over_ = true;
  for (const auto& [number, pending] : pending_) {
    ++refused_at_end_;
    stream_.answer_command(rig::Reason::command_not_now,
                           fmt::format("refused: {}: the run ended before it could take effect (sender '{}')",
                                       change_text(pending.key, pending.value), shown(pending.sender)),
                           pending.value);
  }
  pending_.clear();
  // Send the counts once more, so that receivers get the final ones.
  if (mailbox_ != nullptr) send_state();
}

void RemoteCommands::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  if (record.reason == rig::Reason::start_command) {
    settle_named(record.reason, start_name);
  } else if (record.reason == rig::Reason::question_answered) {
    settle_named(record.reason, continue_name);
  } else if (rig::is_adjustment(record.reason)) {
    if (const auto it = pending_.find(static_cast<std::uint32_t>(record.reason_value)); it != pending_.end()) {
      settle(record.reason, it);
    }
  }
  if (record.reason != rig::Reason::none) asking_ = by_person_ && !names_.question_of(record).empty();
  if (record.time_s >= next_state_s_) {
    send_state();
    next_state_s_ = (std::floor(record.time_s / state_period_s) + 1.0) * state_period_s;
  }
}

void RemoteCommands::send_state() {
  command_state_t state{};
  state.enabled = static_cast<std::int8_t>(enabled());
  state.waiting = static_cast<std::int8_t>(waiting_);
  if (authority_) {
    state.session = authority_->session();
    state.last_sequence = authority_->last_sequence();
  }
  if (listener_ != nullptr) {
    const CommandListener::Counts counts = listener_->counts();
    state.stops = static_cast<std::int64_t>(counts.stops);
    state.refused = static_cast<std::int64_t>(counts.refused + refused_at_end_);
    state.malformed = static_cast<std::int64_t>(counts.malformed);
    state.dropped = static_cast<std::int64_t>(counts.dropped);
  }
  state.accepted = static_cast<std::int64_t>(accepted_);
  stream_.send_command_state(std::move(state));
}

}  // namespace abs_hil::commands
