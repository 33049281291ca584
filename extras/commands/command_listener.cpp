// Receives commands in a thread of its own and answers them; a stop counts at once, from anybody.
#include "commands/command_listener.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <chrono>
#include <utility>

#include "rig/formatted_text.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::commands {
namespace {

constexpr std::size_t packets_per_poll = 32;
constexpr std::size_t most_waiting = 64;
constexpr int answers_per_second = 10;
constexpr std::size_t shown_text_max_characters = 64;
constexpr int thread_wait_ms = 50;
constexpr int tcpq_timeout_ms = 200;
constexpr std::string_view too_long = "too long for a command";

}  // namespace

CommandListener::CommandListener(telemetry::LcmOutlet& outlet, telemetry::MessageStream& stream,
                                 std::function<void()> on_stop)
    : outlet_(outlet), stream_(stream), on_stop_(std::move(on_stop)) {
  // A log file delivers no messages, and its descriptor cannot be polled.
  if (outlet_.provider() == "file") return;
  if (outlet_.provider() == "udpm") {
    udpm_.emplace(outlet_.url(), stream_.command_channel());
    listening_ = true;
    return;
  }
  Receiver::Take take_packet = [this](const std::string&, std::span<const std::uint8_t> packet) {
    packet.size() > UdpmReceiver::payload_max ? hand_over(too_long, false) : take(packet);
  };
  if (outlet_.provider() == "memq") {
    receiver_.emplace(outlet_, stream_.command_channel(), std::move(take_packet));
  } else {
    receiver_.emplace(outlet_.url(), stream_.command_channel(), std::move(take_packet));
  }
  listening_ = true;
}

void CommandListener::end_thread() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
}

void CommandListener::finish() {
  end_thread();
  listening_ = false;
  answer_waiting(most_waiting);
}

void CommandListener::listen() {
  if (!listening() || thread_.joinable()) return;
  thread_ = std::jthread([this](const std::stop_token& stop) { listen_until(stop); });
}

void CommandListener::listen_until(const std::stop_token& stop) {
  runtime::keep_signals_away();
  while (!stop.stop_requested()) {
    if (receive(thread_wait_ms) || file_descriptor() >= 0) continue;
    receiver_->poll(1);  // the tcpq server is away: this looks for it once a second
    std::this_thread::sleep_for(std::chrono::milliseconds(thread_wait_ms));
  }
}

bool CommandListener::receive(int timeout_ms) {
  pollfd ready{file_descriptor(), POLLIN, 0};
  if (ready.fd < 0 || ::poll(&ready, 1, timeout_ms) <= 0) return false;
  if (udpm_) {
    const UdpmReceiver::Arrival arrival = udpm_->next();
    dropped_by_kernel_.store(udpm_->dropped(), std::memory_order_relaxed);
    if (arrival.too_long) {
      hand_over(too_long, false);
    } else if (arrival.any) {
      take(arrival.payload);
    }
    return true;
  }
  if (outlet_.provider() == "tcpq") {
    // A server that stalls in the middle of a message must not keep the run from ending.
    constexpr timeval timeout{.tv_sec = 0, .tv_usec = suseconds_t{tcpq_timeout_ms} * 1000};
    static_cast<void>(::setsockopt(ready.fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout));
  }
  receiver_->poll(1);
  return true;
}

void CommandListener::poll() {
  if (!listening()) return;
  for (std::size_t i = 0; i < packets_per_poll && !thread_.joinable(); ++i) {
    if (!receive(0)) break;
  }
  answer_waiting(packets_per_poll);
}

void CommandListener::answer_waiting(std::size_t at_most) {
  for (std::size_t i = 0; i < at_most; ++i) {
    Arrival arrival;
    {
      const std::lock_guard lock(mutex_);
      if (arrivals_.empty()) return;
      arrival = std::move(arrivals_.front());
      arrivals_.pop_front();
    }
    answer(arrival);
  }
}

void CommandListener::take(std::span<const std::uint8_t> packet) {
  command_t command{};
  if (const std::string_view problem = telemetry::decode_checked(packet, command); !problem.empty()) {
    return hand_over(problem, false);
  }
  const bool is_stop = command.command == "stop";
  hand_over(std::move(command), is_stop);
}

void CommandListener::hand_over(Arrival arrival, bool is_stop) {
  if (is_stop) {
    stops_.fetch_add(1, std::memory_order_release);
    if (on_stop_) on_stop_();
  }
  const std::lock_guard lock(mutex_);
  if (arrivals_.size() < most_waiting) {
    arrivals_.push_back(std::move(arrival));
  } else if (is_stop) {
    arrivals_.front() = std::move(arrival);  // the queue is full, but a stop must be answered
    dropped_.fetch_add(1, std::memory_order_relaxed);
  } else {
    dropped_.fetch_add(1, std::memory_order_relaxed);
  }
}

void CommandListener::answer(const Arrival& arrival) {
  if (const auto* problem = std::get_if<std::string_view>(&arrival)) {
    ++malformed_;
    return say(rig::Reason::command_malformed, std::string("refused a packet: ").append(*problem), malformed_, false);
  }
  const auto& command = std::get<command_t>(arrival);
  const std::string from = " (sender '" + rig::clean_text(command.sender, shown_text_max_characters) + "')";
  if (command.command == "stop") {
    ++stops_answered_;
    return say(rig::Reason::stop_command, "stop accepted" + from, stops_answered_, stops_answered_ == 1);
  }
  const std::optional<CommandAnswer> judged =
      judge_ ? judge_(command)
             : CommandAnswer{rig::Reason::commands_not_enabled,
                             "refused '" + rig::clean_text(command.command, shown_text_max_characters) +
                                 "': only 'stop' is accepted, as this run has commands.enabled = false"};
  if (!judged) return;
  ++refused_;
  say(judged->reason, judged->message + from, refused_, judged->authentic);
}

void CommandListener::say(rig::Reason reason, std::string message, std::uint64_t count, bool always) {
  const double now_s = stream_.time_s();
  if (now_s - answer_window_start_s_ >= 1.0) {
    answer_window_start_s_ = now_s;
    answers_in_window_ = 0;
  }
  // A flood of messages must not cause a flood of answers.
  if (!always && answers_in_window_ >= answers_per_second) return;
  if (!always) ++answers_in_window_;
  stream_.answer_command(reason, std::move(message), static_cast<double>(count));
}

CommandListener::Counts CommandListener::counts() const noexcept {
  return {.stops = stops_.load(std::memory_order_relaxed),
          .refused = refused_,
          .malformed = malformed_,
          .dropped = dropped_.load(std::memory_order_relaxed) + dropped_by_kernel_.load(std::memory_order_relaxed)};
}

}  // namespace abs_hil::commands
