// Receives commands in a thread of its own and answers them; a stop counts at once, from anybody.
#include "commands/command_listener.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <chrono>
#include <cstring>
#include <utility>

#include "rig/clean_text.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/checked_decode.hpp"
#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr std::size_t packets_per_poll = 32;
constexpr std::size_t most_waiting = 64;
constexpr int answers_per_second = 10;
constexpr std::size_t shown_text_max_characters = 64;
constexpr int thread_wait_ms = 50;
constexpr std::chrono::seconds reconnect_after{1};
constexpr int tcpq_timeout_ms = 200;
/// LCM's default queue holds 30 messages, and a flood would push a stop out of it.
constexpr int lcm_queue_capacity = 1024;
constexpr std::string_view too_long = "too long for a command";

}  // namespace

CommandListener::CommandListener(LcmOutlet& outlet, MessageStream& stream, std::function<void()> on_stop)
    : outlet_(outlet), stream_(stream), on_stop_(std::move(on_stop)) {
  // A log file delivers no messages, and its descriptor cannot be polled.
  if (outlet_.provider() == "file") return;
  if (outlet_.provider() == "udpm") {
    udpm_.emplace(outlet_.url(), stream_.command_channel());
    listening_ = true;
    return;
  }
  if (outlet_.provider() == "memq") {
    lcm_ = outlet_.lcm().getUnderlyingLCM();
  } else {
    own_lcm_ = std::make_unique<lcm::LCM>(outlet_.url());
    if (!own_lcm_->good()) return;
    lcm_ = own_lcm_->getUnderlyingLCM();
  }
  subscribe();
  listening_ = true;
}

void CommandListener::subscribe() {
  subscription_ = lcm_subscribe(lcm_, stream_.command_channel().c_str(), &on_packet, this);
  lcm_subscription_set_queue_capacity(subscription_, lcm_queue_capacity);
}

CommandListener::~CommandListener() {
  end_thread();
  // An own LCM object unsubscribes by itself; with tcpq an explicit call would search for the server again.
  if (!own_lcm_ && subscription_ != nullptr) lcm_unsubscribe(lcm_, subscription_);
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
  const Endpoint server = outlet_.provider() == "tcpq" ? endpoint_of(parse_lcm_url(outlet_.url())) : Endpoint{};
  while (!stop.stop_requested()) {
    const bool connected = file_descriptor() >= 0;
    if (receive(thread_wait_ms) || connected) continue;
    // The tcpq server is away: look for it no more often than publishing does.
    for (auto waited = std::chrono::milliseconds(0); waited < reconnect_after && !stop.stop_requested();
         waited += std::chrono::milliseconds(thread_wait_ms)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(thread_wait_ms));
    }
    if (stop.stop_requested() || ask_tcpq_server(server, tcpq_timeout_ms) != TcpqServer::answers) continue;
    // Subscribing connects again. lcm_handle would connect too, but then wait for a message without a time limit.
    lcm_unsubscribe(lcm_, subscription_);
    subscribe();
  }
}

bool CommandListener::receive(int timeout_ms) {
  // lcm_handle_timeout does not work here: its select() cannot handle a descriptor of -1 (tcpq without server) or above
  // 1023.
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
  if (lcm_handle(lcm_) != 0) return false;
  if (!std::exchange(packet_.arrived, false)) return true;
  if (packet_.size > packet_.bytes.size()) {
    hand_over(too_long, false);
  } else {
    take(std::span(packet_.bytes).first(packet_.size));
  }
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

// Only copies the packet: publishing an answer may throw, and must not throw through LCM's C code.
void CommandListener::on_packet(const lcm_recv_buf_t* received, const char* /*channel*/, void* self) noexcept {
  Packet& packet = static_cast<CommandListener*>(self)->packet_;
  packet.size = received->data_size;
  packet.arrived = true;
  if (packet.size <= packet.bytes.size()) std::memcpy(packet.bytes.data(), received->data, packet.size);
}

void CommandListener::take(std::span<const std::uint8_t> packet) {
  command_t command{};
  if (const std::string_view problem = decode_checked(packet, command); !problem.empty()) {
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

}  // namespace abs_hil::telemetry
