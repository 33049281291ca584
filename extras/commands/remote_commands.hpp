#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "commands/authority.hpp"
#include "commands/command_listener.hpp"
#include "config/live_settings.hpp"
#include "experiment/run_logic.hpp"
#include "rig/record_sink.hpp"
#include "rig/run_names.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::commands {

/// Carries out the remote commands that a run receives over LCM. It checks the sender, the request, and whether the
/// request is possible now; it hands the change to the real-time thread; it answers when the record of a cycle shows
/// the change. It is a sink behind the message stream and works in the stream's thread.
class RemoteCommands final : public rig::RecordSink {
 public:
  /// `stream` must outlive it. Throws what read_key throws if commands are enabled.
  /// @param names  whose phases ask questions
  RemoteCommands(const config::Settings& settings, telemetry::MessageStream& stream, rig::RunNames names = {});

  /// Sets the mailbox that receives changes. Without a mailbox every command is refused as too early.
  void set_mailbox(experiment::AdjustmentMailbox& mailbox) { mailbox_ = &mailbox; }
  /// Sets the listener whose counts ABS_COMMAND_STATE publishes.
  void set_listener(const CommandListener& listener) { listener_ = &listener; }

  /// Judges a command for the command listener (CommandJudge).
  [[nodiscard]] std::optional<CommandAnswer> judge(const command_t& command);

  void consume(const rig::CycleRecord& record, double distance_m) override;

  /// Ends the service with the run: refuses pending changes and every later command.
  void refuse_pending();

  [[nodiscard]] bool enabled() const noexcept { return authority_.has_value(); }

 private:
  /// A change that the real-time thread has not yet confirmed.
  struct Pending {
    std::string key;
    double value{0.0};
    std::string sender;
  };
  CommandAnswer carry_out(const command_t& command, bool& taken);
  void settle(rig::Reason reason, std::map<std::uint32_t, Pending>::iterator pending);
  void settle_named(rig::Reason reason, std::string_view name);
  void send_state();

  telemetry::MessageStream& stream_;
  config::LiveSettings live_;
  std::optional<Authority> authority_{};
  experiment::AdjustmentMailbox* mailbox_{nullptr};
  const CommandListener* listener_{nullptr};
  std::map<std::uint32_t, Pending> pending_{};
  std::uint64_t accepted_{0};
  std::uint64_t refused_at_end_{0};
  rig::RunNames names_;
  bool waiting_;
  bool by_person_;      ///< questions are answered by a person, not by the run itself
  bool asking_{false};  ///< the present phase asks
  bool over_{false};
  double next_state_s_{0.0};
};

}  // namespace abs_hil::commands
