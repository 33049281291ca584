#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "commands/authority.hpp"
#include "commands/command_listener.hpp"
#include "config/live_settings.hpp"
#include "experiment/adjustment.hpp"
#include "rig/record_sink.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::commands {

/// Carries out the commands that a run takes over LCM: checks who sends them, what they ask for and whether it can be
/// done now, hands the change to the real-time thread, and answers when the record of a cycle shows that it holds.
/// A sink behind the message stream, in its thread.
class CommandDesk final : public rig::RecordSink {
 public:
  /// `stream` must outlive it. Throws what read_key throws where commands are enabled.
  CommandDesk(const config::Settings& settings, telemetry::MessageStream& stream);

  /// Where changes go; without it every command is refused as one that comes too early.
  void drive(experiment::AdjustmentMailbox& mailbox) { mailbox_ = &mailbox; }
  /// Whose counts ABS_COMMAND_STATE tells.
  void count(const telemetry::CommandListener& listener) { listener_ = &listener; }

  /// The judge of the command listener.
  [[nodiscard]] std::optional<telemetry::CommandAnswer> judge(const command2_t& command);

  void consume(const rig::CycleRecord& record, double distance_m) override;

  /// The run is over: refuses what has not taken effect, and all that is put before the judge from now on.
  void refuse_pending();

  [[nodiscard]] bool enabled() const noexcept { return authority_.has_value(); }

 private:
  /// A change on its way to the real-time thread.
  struct Pending {
    std::string key;
    double value{0.0};
    std::string sender;
  };
  telemetry::CommandAnswer carry_out(const command2_t& command, bool& taken);
  void settle(rig::Reason reason, std::map<std::uint32_t, Pending>::iterator pending);
  void send_state();

  telemetry::MessageStream& stream_;
  config::LiveSettings live_;
  std::optional<Authority> authority_{};
  experiment::AdjustmentMailbox* mailbox_{nullptr};
  const telemetry::CommandListener* listener_{nullptr};
  std::map<std::uint32_t, Pending> pending_{};
  std::uint64_t accepted_{0};
  std::uint64_t refused_at_end_{0};
  bool waiting_;
  bool over_{false};
  double next_state_s_{0.0};
};

}  // namespace abs_hil::commands
