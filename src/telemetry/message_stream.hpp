#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/command_state_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "rig/record_sink.hpp"
#include "telemetry/event_detector.hpp"
#include "telemetry/message_codec.hpp"
#include "telemetry/outlet.hpp"
#include "telemetry/status_snapshot.hpp"

namespace abs_hil::telemetry {

/// What is being run, for ABS_EXPERIMENT.
struct ExperimentInfo {
  std::string experiment;
  std::string controller;
  std::string plant;
  std::string backend;
  std::string config_json;  ///< effective configuration
  std::string version;
};

/// How often messages go out.
struct StreamOptions {
  std::string channel_prefix{"ABS_"};       ///< letters, digits, '_', '-' and '/'; at most 48 characters
  std::uint32_t telemetry_every_cycles{1};  ///< decimation of TELEMETRY, >= 1
  double status_period_s{1.0};              ///< of run time, > 0
  double experiment_period_s{5.0};          ///< of run time, > 0
};

/// Throws std::invalid_argument, naming the prefix and what it may hold, for one that is no StreamOptions' prefix.
void check_channel_prefix(std::string_view prefix);

/// Turns records into the messages of the ABS_ channels and gives the same ones to every outlet. Each channel's
/// sequence is consecutive from 0; all stamps and times are those of the records, so that a run on virtual time gives
/// the same bytes again. One stream for each run, used from one thread.
class MessageStream : public rig::RecordSink {
 public:
  /// Throws std::invalid_argument for an option out of range, naming it.
  MessageStream(StreamOptions options, ExperimentInfo experiment, StatusSource status);

  /// `outlet` must outlive the stream. Before the first record.
  void add(Outlet& outlet) { outlets_.push_back(&outlet); }

  /// What has to be said last, after the last record: called once, at the beginning of finish().
  void set_farewell(std::function<void()> farewell) { farewell_ = std::move(farewell); }

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Sends what the farewell has to say and a last ABS_STATUS, and finishes every outlet, then throws the first
  /// FileError of theirs.
  void finish() override;

  /// Where no records come, as between two runs: what is sent from now on is of this time.
  void pass_time(std::int64_t stamp_ns, double time_s) noexcept;

  /// An event of kind "command": the answer to a message on ABS_COMMAND.
  void answer_command(rig::Reason reason, std::string message, double value);

  /// An event of kind "fault" beside those that the records give rise to: one found outside of the cycle.
  void report_fault(rig::Reason reason, double value, std::string message);
  /// A change that took effect in the latest record's cycle, on ABS_ADJUSTMENT.
  void send_adjustment(std::string name, double value);
  /// What senders of commands need to know, on ABS_COMMAND_STATE; stamp and sequence are filled in.
  void send_command_state(command_state_t state);

  [[nodiscard]] const std::string& command_channel() const noexcept { return command_channel_; }
  /// Run time of the latest record, or that which pass_time() gave; s.
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
  void send_experiment();

  StreamOptions options_;
  StatusSource status_;
  std::vector<Outlet*> outlets_;
  Channel telemetry_;
  Channel measurement_;
  Channel adjustment_;
  Channel command_state_;
  Channel status_channel_;
  Channel event_;
  Channel experiment_;
  std::string command_channel_;
  experiment_t experiment_message_{};
  EventDetector detector_;
  EncodeBuffer buffer_;
  rig::CycleRecord latest_{};
  std::uint64_t next_telemetry_cycle_{0};
  double next_status_s_{0.0};
  double next_experiment_s_{0.0};
  std::function<void()> farewell_;
  bool started_{false};
  bool finished_{false};
};

}  // namespace abs_hil::telemetry
