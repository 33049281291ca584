#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/command_state_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/status_t.hpp"
#include "rig/record_sink.hpp"
#include "rig/run_names.hpp"
#include "rig/timing_summary.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/message_codec.hpp"
#include "telemetry/outlet.hpp"

namespace abs_hil::telemetry {

/// Description of the run: what ABS_EXPERIMENT says, and names.
struct ExperimentInfo : experiment_t {
  rig::RunNames names{};  ///< of phases and signals, for events and telemetry
};

/// Data from the owner of the run for ABS_STATUS and the status line. All counts are since the start.
struct StatusSnapshot {
  std::uint64_t cycles{0};
  std::uint64_t telemetry_drops{0};     ///< records that found the ring full
  std::uint64_t gate_interventions{0};  ///< commands that the gate limited, blocked or refused
  /// Share of the time in which the gate's checks could not judge; NaN: not known.
  double checks_unjudged{rig::unknown};
  bool realtime{false};  ///< real-time scheduling and locked memory are in force
  rig::TimingSummary timing{};
};

/// Called from the telemetry thread, at most ten times a second. Empty: counts are 0 and durations NaN.
using StatusSource = std::function<StatusSnapshot()>;

/// Channel prefix and rates of the messages.
struct StreamOptions {
  std::string channel_prefix{"ABS_"};       ///< letters, digits, '_', '-' and '/'; at most 48 characters
  std::uint32_t telemetry_every_cycles{1};  ///< decimation of TELEMETRY, >= 1
  double status_period_s{1.0};              ///< of run time, > 0
  double experiment_period_s{5.0};          ///< of run time, > 0
};

/// Turns records into the messages of the ABS_ channels and gives the same messages to every outlet. Each channel's
/// sequence counts from 0 without gaps. All stamps and times are those of the records, so that a run on virtual time
/// always gives the same bytes. Use one stream for each run, from one thread.
class MessageStream : public rig::RecordSink {
 public:
  /// Throws std::invalid_argument for an option out of range, naming it.
  MessageStream(StreamOptions options, ExperimentInfo experiment, StatusSource status);

  /// Adds an outlet before the first record. `outlet` must outlive the stream.
  void add(Outlet& outlet) { outlets_.push_back(&outlet); }

  /// A function that sends the last messages, after the last record. finish() calls it once, at its beginning.
  void set_before_end(std::function<void()> before_end) { before_end_ = std::move(before_end); }

  /// A function that makes the tag at the end of every answer's message from the answer without it.
  void set_answer_tag(std::function<std::string(const event_t&)> tag) { answer_tag_ = std::move(tag); }

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Calls what `set_before_end` was given, sends a last ABS_STATUS and finishes every outlet. Then it throws the first
  /// files::FileError of an outlet.
  void finish() override;

  /// Sets the time of the next messages while there are no records, as between two runs.
  void pass_time(std::int64_t stamp_ns, double time_s) noexcept;

  /// An event of kind "command": the answer to a message on ABS_COMMAND.
  void answer_command(rig::Reason reason, std::string message, double value);

  /// An event of kind "fault" that was found outside the cycle, beside those from the records.
  void report_fault(rig::Reason reason, double value, std::string message);
  /// Publishes a change that took effect in the latest record's cycle, on ABS_ADJUSTMENT.
  void send_adjustment(std::string name, double value);
  /// Publishes the state for senders of commands, on ABS_COMMAND_STATE. It fills in stamp and sequence.
  void send_command_state(command_state_t state);

  [[nodiscard]] const std::string& command_channel() const noexcept { return command_channel_; }
  /// Run time of the latest record or of pass_time(), s.
  [[nodiscard]] double time_s() const noexcept { return latest_.time_s; }
  /// Messages that outlets could not pass on.
  [[nodiscard]] std::uint64_t failures() const noexcept;

 private:
  struct Channel {
    std::string name;
    std::int64_t next_sequence{0};
  };
  template <class Message>
  void send(Channel& channel, Message& message);
  void send_event(std::string_view kind, rig::Reason reason, double value, std::string message);
  void send_status();

  StreamOptions options_;
  StatusSource status_;
  std::vector<Outlet*> outlets_;
  Channel telemetry_{options_.channel_prefix + "TELEMETRY"};
  Channel adjustment_{options_.channel_prefix + "ADJUSTMENT"};
  Channel command_state_{options_.channel_prefix + "COMMAND_STATE"};
  Channel status_channel_{options_.channel_prefix + "STATUS"};
  Channel event_{options_.channel_prefix + "EVENT"};
  Channel experiment_{options_.channel_prefix + "EXPERIMENT"};
  std::string command_channel_{options_.channel_prefix + "COMMAND"};
  telemetry_t telemetry_message_{};
  rig::RunNames names_;
  EventDetector detector_;
  experiment_t experiment_message_;
  EncodeBuffer buffer_;
  rig::CycleRecord latest_{};
  std::uint64_t next_telemetry_cycle_{0};
  double next_status_s_{0.0};
  double next_experiment_s_{0.0};
  std::function<void()> before_end_;
  std::function<std::string(const event_t&)> answer_tag_;
  bool started_{false};
  bool finished_{false};
};

}  // namespace abs_hil::telemetry
