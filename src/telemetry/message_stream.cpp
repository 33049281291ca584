// Sends telemetry, status, experiment and events, each at its rate, to every outlet.
#include "telemetry/message_stream.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <tuple>

#include "abs_hil/adjustment_t.hpp"
#include "files/result_file.hpp"
#include "rig/formatted_text.hpp"
#include "rig/reason_text.hpp"

namespace abs_hil::telemetry {
namespace {

void check_channel_prefix(std::string_view prefix) {
  constexpr std::size_t prefix_max = 48;  // LCM's limit is 63 characters with the name
  const auto allowed = [](unsigned char c) {
    // No characters of regular expressions, because a subscription is a regular expression.
    return c < 0x80 && (std::isalnum(c) != 0 || c == '_' || c == '-' || c == '/');
  };
  if (prefix.size() > prefix_max || !std::all_of(prefix.begin(), prefix.end(), allowed)) {
    throw std::invalid_argument("channel prefix '" + rig::clean_text(prefix, 80) +
                                "' is not valid; give at most 48 letters, digits, '_', '-' and '/'");
  }
}

void check(const StreamOptions& options) {
  check_channel_prefix(options.channel_prefix);
  if (options.telemetry_every_cycles == 0) throw std::invalid_argument("telemetry_every_cycles must be at least 1");
  if (!(options.status_period_s > 0.0)) throw std::invalid_argument("status_period_s must be above 0 s");
  if (!(options.experiment_period_s > 0.0)) throw std::invalid_argument("experiment_period_s must be above 0 s");
}

/// The next time on the grid of `period_s` after `now_s`, so that a late message does not delay later ones.
double next_on_grid(double now_s, double period_s) { return (std::floor(now_s / period_s + 1e-9) + 1.0) * period_s; }

void put_timing(const rig::TimingSummary& timing, status_t& m) {
  const auto four = [](const rig::DurationQuantiles& q) { return std::tie(q.p50_us, q.p99_us, q.p99_9_us, q.max_us); };
  std::tie(m.wakeup_latency_p50_us, m.wakeup_latency_p99_us, m.wakeup_latency_p99_9_us, m.wakeup_latency_max_us) =
      four(timing.wakeup_latency);
  std::tie(m.read_p50_us, m.read_p99_us, m.read_p99_9_us, m.read_max_us) = four(timing.read);
  std::tie(m.control_p50_us, m.control_p99_us, m.control_p99_9_us, m.control_max_us) = four(timing.control);
  std::tie(m.write_p50_us, m.write_p99_us, m.write_p99_9_us, m.write_max_us) = four(timing.write);
  std::tie(m.cycle_time_p50_us, m.cycle_time_p99_us, m.cycle_time_p99_9_us, m.cycle_time_max_us) =
      four(timing.cycle_time);

  const rig::OverrunCounts& late = timing.overruns;
  const auto of = [&late](rig::OverrunCause cause) { return static_cast<std::int64_t>(late.of(cause)); };
  m.overruns = static_cast<std::int64_t>(late.total);
  m.overruns_wakeup = of(rig::OverrunCause::wakeup);
  m.overruns_read = of(rig::OverrunCause::read);
  m.overruns_control = of(rig::OverrunCause::control);
  m.overruns_write = of(rig::OverrunCause::write);
  m.overruns_record = of(rig::OverrunCause::record);
  m.overruns_startup = static_cast<std::int64_t>(late.startup);
  m.overruns_longest_run = static_cast<std::int64_t>(late.longest_run);
  m.ticks_missed = static_cast<std::int64_t>(late.ticks_missed);
}

}  // namespace

MessageStream::MessageStream(StreamOptions options, ExperimentInfo experiment, StatusSource status)
    : options_(std::move(options)),
      status_(std::move(status)),
      names_(std::move(experiment.names)),
      detector_(names_),
      experiment_message_(std::move(experiment)) {
  check(options_);
  telemetry_message_ = blank_message(names_);
}

void MessageStream::consume(const rig::CycleRecord& record, double distance_m) {
  latest_ = record;
  if (!started_ || record.time_s >= next_experiment_s_) {
    send(experiment_, experiment_message_);
    next_experiment_s_ = next_on_grid(record.time_s, options_.experiment_period_s);
  }
  // A replay needs the answer. It may have come from a person or from the simulation.
  if (record.reason == rig::Reason::question_answered) send_adjustment("continue", 0.0);
  if (auto event = detector_.observe(record)) {
    send_event(event->kind, record.reason, record.reason_value, std::move(event->message));
  }
  if (record.sequence >= next_telemetry_cycle_) {
    put_record(record, distance_m, names_, telemetry_message_);
    send(telemetry_, telemetry_message_);
    next_telemetry_cycle_ = (record.sequence / options_.telemetry_every_cycles + 1) * options_.telemetry_every_cycles;
  }
  if (!started_ || record.time_s >= next_status_s_) {
    send_status();
    next_status_s_ = next_on_grid(record.time_s, options_.status_period_s);
  }
  started_ = true;
}

void MessageStream::finish() {
  if (finished_) return;
  finished_ = true;
  if (before_end_) before_end_();
  if (started_) send_status();
  std::exception_ptr first_error;
  for (Outlet* outlet : outlets_) {
    try {
      outlet->finish();
    } catch (const files::FileError&) {
      if (!first_error) first_error = std::current_exception();
    }
  }
  if (first_error) std::rethrow_exception(first_error);
}

void MessageStream::pass_time(std::int64_t stamp_ns, double time_s) noexcept {
  latest_.stamp_ns = stamp_ns;
  latest_.time_s = time_s;
}

void MessageStream::answer_command(rig::Reason reason, std::string message, double value) {
  send_event(event_kind::command, reason, value, std::move(message));
}

void MessageStream::report_fault(rig::Reason reason, double value, std::string message) {
  send_event(event_kind::fault, reason, value, std::move(message));
}

void MessageStream::send_adjustment(std::string name, double value) {
  adjustment_t message{};
  message.cycle = static_cast<std::int64_t>(latest_.sequence);
  message.name = std::move(name);
  message.value = value;
  send(adjustment_, message);
}

void MessageStream::send_command_state(command_state_t state) { send(command_state_, state); }

std::uint64_t MessageStream::failures() const noexcept {
  std::uint64_t sum = 0;
  for (const Outlet* outlet : outlets_) sum += outlet->failures();
  return sum;
}

template <class Message>
void MessageStream::send(Channel& channel, Message& message) {
  message.stamp_ns = latest_.stamp_ns;
  message.sequence = channel.next_sequence++;
  const auto bytes = buffer_.encode(message);
  for (Outlet* outlet : outlets_) outlet->send(channel.name, bytes, latest_.time_s);
}

void MessageStream::send_event(std::string_view kind, rig::Reason reason, double value, std::string message) {
  event_t event{};
  event.time_s = latest_.time_s;
  event.kind = kind;
  event.phase = static_cast<std::int8_t>(latest_.phase);
  event.reason = static_cast<std::int16_t>(reason);
  event.reason_text = rig::reason_text(reason, value, names_.signals);
  event.value = value;
  event.message = std::move(message);
  if (answer_tag_ && kind == event_kind::command) {
    event.stamp_ns = latest_.stamp_ns;  // as `send` sets them
    event.sequence = event_.next_sequence;
    event.message += answer_tag_(event);
  }
  send(event_, event);
}

void MessageStream::send_status() {
  const StatusSnapshot snapshot = status_ ? status_() : StatusSnapshot{};
  status_t m{};
  m.time_s = latest_.time_s;
  m.phase = static_cast<std::int8_t>(latest_.phase);
  m.cycles = static_cast<std::int64_t>(snapshot.cycles);
  m.telemetry_drops = static_cast<std::int64_t>(snapshot.telemetry_drops);
  m.publish_failures = static_cast<std::int64_t>(failures());
  m.realtime = static_cast<std::int8_t>(snapshot.realtime);
  m.unjudged_share = snapshot.checks_unjudged;
  put_timing(snapshot.timing, m);
  send(status_channel_, m);
}

}  // namespace abs_hil::telemetry
