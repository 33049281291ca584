#include "watch/run_view.hpp"

#include <algorithm>
#include <cmath>

#include "rig/formatted_text.hpp"
#include "telemetry/events.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::watch {
namespace {

constexpr std::size_t samples_max = 600'000;  // 60 s at 10 kHz
constexpr std::size_t text_max_bytes = 200;
constexpr std::size_t name_max_bytes = 40;
constexpr std::size_t values_max = 16;
/// Networks may deliver a few messages out of order. A sequence number further back belongs to another run.
constexpr std::int64_t late_messages_max = 16;

double known(double truth, double estimate) { return std::isnan(truth) ? estimate : truth; }

void make_printable(std::string& text) { text = rig::printable(text, text_max_bytes); }

}  // namespace

bool RunView::admit(std::int64_t sequence, std::int64_t& latest, std::int64_t now_ns) {
  last_received_ns_ = now_ns;
  if (runs_ == 0) runs_ = 1;
  if (sequence <= latest) {
    const bool late = sequence > latest - late_messages_max && sequence > 0;
    if (late) return false;
    begin_run();  // also resets `latest`
  }
  return true;
}

void RunView::begin_run() noexcept {
  ++runs_;
  samples_.clear();
  events_.clear();
  telemetry_.reset();
  status_.reset();
  experiment_.reset();
  telemetry_sequence_ = status_sequence_ = event_sequence_ = experiment_sequence_ = -1;
  lost_ = 0;
}

void RunView::take(const telemetry_t& message, std::int64_t now_ns) {
  if (!admit(message.sequence, telemetry_sequence_, now_ns)) return;
  const bool gap = telemetry_sequence_ >= 0 && message.sequence > telemetry_sequence_ + 1;
  if (gap) lost_ += message.sequence - telemetry_sequence_ - 1;
  telemetry_sequence_ = message.sequence;
  telemetry_ = message;
  if (!std::isfinite(message.time_s)) return;
  samples_.push_back({.received_ns = now_ns,
                      .time_s = message.time_s,
                      .omega1_rad_s = known(message.omega1_rad_s, message.omega1_est_rad_s),
                      .omega2_rad_s = known(message.omega2_rad_s, message.omega2_est_rad_s),
                      .slip = known(message.slip, message.slip_est),
                      .slip_ref = message.slip_ref,
                      .theta_est_N = message.theta_est_N,
                      .theta_N = message.theta_N,
                      .after_gap = gap});
  while (samples_.size() > samples_max || samples_.front().time_s < message.time_s - window_s_) samples_.pop_front();
}

void RunView::take(const status_t& message, std::int64_t now_ns) {
  if (!admit(message.sequence, status_sequence_, now_ns)) return;
  status_sequence_ = message.sequence;
  status_ = message;
}

void RunView::take(const event_t& message, std::int64_t now_ns) {
  if (message.kind == telemetry::event_kind::command && message.sequence <= event_sequence_) {
    // The command was answered between two runs of a series, with new sequence numbers: keep the ended run in view.
    last_received_ns_ = now_ns;
  } else {
    if (!admit(message.sequence, event_sequence_, now_ns)) return;
    event_sequence_ = message.sequence;
  }
  events_.push_front(message);
  event_t& event = events_.front();
  for (std::string* text : {&event.kind, &event.reason_text, &event.message}) make_printable(*text);
  if (events_.size() > events_max) events_.pop_back();
}

void RunView::take(const experiment_t& message, std::int64_t now_ns) {
  if (!admit(message.sequence, experiment_sequence_, now_ns)) return;
  experiment_sequence_ = message.sequence;
  experiment_ = message;
  experiment_t& e = *experiment_;
  for (std::string* text : {&e.experiment, &e.controller, &e.plant, &e.backend, &e.version}) make_printable(*text);
}

std::string RunView::name_of(rig::Phase kind) const {
  const bool named =
      telemetry_ && telemetry_->phase == static_cast<std::int8_t>(kind) && !telemetry_->phase_name.empty();
  return named ? rig::printable(telemetry_->phase_name, name_max_bytes) : std::string(rig::name_of(kind));
}

std::vector<NamedValue> RunView::values() const {
  std::vector<NamedValue> shown;
  if (!telemetry_) return shown;
  for (const telemetry::NamedValue& named : telemetry::values_of(*telemetry_)) {
    if (shown.size() < values_max) shown.push_back({rig::printable(named.name, name_max_bytes), named.value});
  }
  return shown;
}

std::optional<double> RunView::silence_s(std::int64_t now_ns) const noexcept {
  if (!last_received_ns_) return std::nullopt;
  return static_cast<double>(std::max<std::int64_t>(now_ns - *last_received_ns_, 0)) * 1e-9;
}

std::size_t RunView::messages_last_second(std::int64_t now_ns) const noexcept {
  const auto first = std::partition_point(samples_.begin(), samples_.end(), [now_ns](const Sample& sample) {
    return sample.received_ns <= now_ns - 1'000'000'000;
  });
  return static_cast<std::size_t>(samples_.end() - first);
}

}  // namespace abs_hil::watch
