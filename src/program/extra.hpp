// What an extra (a room of extras/, which a laboratory may leave out) brings to the program and to a run. No file of
// src includes one: the build makes the list of those that it has (cmake/Extras.cmake).
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "program/subcommands.hpp"
#include "rig/record_sink.hpp"
#include "run/run.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::program {

/// An extra's part in one run, in the order of the calls. It is made before the run and lives until the run's summary
/// is written. All calls come from the slow thread.
class RunPart {
 public:
  virtual ~RunPart() = default;

  /// The run is put together and its board is configured; nothing has moved. Throws std::invalid_argument if this run
  /// cannot be. @param run  outlives this object
  virtual void attach(run::Run& /*run*/) {}
  /// The run has messages and a network; both outlive this object. Throws telemetry::LcmError.
  virtual void open(telemetry::LcmOutlet& /*lcm*/, telemetry::MessageStream& /*stream*/) {}
  /// Receives the run's records behind the message stream; null: it wants none.
  virtual rig::RecordSink* sink() { return nullptr; }
  /// The run knows its sinks and takes changes from now on.
  virtual void listen() {}
  /// Called every few milliseconds. Never waits.
  virtual void poll() {}
  /// True after somebody asked for a stop.
  [[nodiscard]] virtual bool stop_requested() const { return false; }
  /// For the summary, what this extra knows of a controller that it brought; null: it brought none.
  [[nodiscard]] virtual nlohmann::ordered_json controller_facts() const { return nullptr; }
};

/// Between two runs of a series: true once a stop is heard. @param time_s  time since the pause began
using StopHeard = std::function<bool(std::chrono::steady_clock::time_point now, double time_s)>;

/// One extra: a row of what it brings. Null: nothing.
struct Extra {
  std::string_view name;
  std::span<const Subcommand> subcommands{};
  void (*begin)(){nullptr};  ///< called once, before the command line is read
  std::unique_ptr<RunPart> (*join)(const RunRequest& request){nullptr};
  StopHeard (*pause)(const RunRequest& request){nullptr};
};

/// The extras of this build. Real-time safe.
[[nodiscard]] std::span<const Extra* const> extras() noexcept;

}  // namespace abs_hil::program
