// Sends one command and waits for its answer.
#include "commands/sender.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <random>
#include <span>

#include "abs_hil/rig/reason.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "commands/authority.hpp"
#include "commands/receiver.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::commands {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds stop_again{50};
/// After its last cycle a run's slow thread ends within this time.
constexpr std::chrono::seconds last_words{1};

/// Why no command can be made for this state; empty if one can.
std::string problem_of(const command_state_t& state) {
  constexpr std::int64_t plausible_sequence_max = std::int64_t{1} << 53U;
  if (state.enabled == 0)
    return "says that the running abs_hil accepts only stop; start it with --set commands.enabled=true";
  if (state.last_sequence >= 0 && state.last_sequence <= plausible_sequence_max) return {};
  return "gives the impossible sequence number " + std::to_string(state.last_sequence) +
         "; look for its forger with abs-spy, or use ttl=0";
}

/// Collects the answers of one running program.
class Answers {
 public:
  Answers(telemetry::LcmOutlet& network, const std::string& prefix, std::string sender, std::string key)
      : sender_(std::move(sender)),
        key_(std::move(key)),
        receiver_(network, prefix + "(EVENT|COMMAND_STATE)",
                  [this](const std::string&, std::span<const std::uint8_t> packet) { take(packet); }) {}

  /// Receives messages until `until`, or until `enough` returns true.
  template <class Enough>
  void wait(Clock::time_point until, Enough enough) {
    while (!enough()) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now()).count();
      if (left <= 0) return;
      pollfd ready{receiver_.file_descriptor(), POLLIN, 0};
      if (::poll(&ready, 1, static_cast<int>(left)) <= 0) continue;
      receiver_.poll(1);
      if (receiver_.file_descriptor() < 0) return;  // the tcpq server is gone, and no answer can come
    }
  }

  [[nodiscard]] bool has_key() const noexcept { return !key_.empty(); }

  std::optional<event_t> answer{};
  std::optional<event_t> without_tag{};  ///< an answer without the key's tag
  std::optional<event_t> ending{};       ///< the event that ended the run, if it arrived while we listened
  std::optional<command_state_t> state{};
  std::string unusable{};  ///< why no command can be made for the latest of the other states

 private:
  void take(std::span<const std::uint8_t> packet) {
    if (event_t event{}; telemetry::decode_checked(packet, event).empty()) return take_event(std::move(event));
    command_state_t received{};
    if (!telemetry::decode_checked(packet, received).empty()) return;
    if (std::string problem = problem_of(received); problem.empty()) {
      state = std::move(received);
    } else {
      unusable = std::move(problem);
    }
  }
  void take_event(event_t event) {
    const bool last_phase = event.phase == telemetry_t::PHASE_STOPPED || event.phase == telemetry_t::PHASE_FAULT;
    if (last_phase && event.kind != "command") ending = event;
    if (event.kind != "command") return;
    if (event.message.find('\'' + sender_ + '\'') == std::string::npos) return;
    const bool counts = key_.empty() || take_tag(event, key_);
    (counts ? answer : without_tag) = std::move(event);
  }

  std::string sender_;
  std::string key_;  ///< empty: every answer counts
  Receiver receiver_;
};

std::string unique_sender() {
  std::random_device random;
  return "send-" + std::to_string(::getpid()) + '-' + std::to_string(random());
}

template <class Message>
void publish(lcm_t* lcm, const std::string& channel, const Message& message) {
  telemetry::EncodeBuffer buffer;
  const auto bytes = buffer.encode(message);
  if (lcm_publish(lcm, channel.c_str(), bytes.data(), static_cast<unsigned int>(bytes.size())) != 0) {
    throw telemetry::LcmError("cannot publish the command on " + channel);
  }
}

Reply reply_of(const Answers& answers) {
  const std::optional<event_t>& answer = answers.answer;
  if (!answer && answers.without_tag) {
    return {Outcome::no_answer,
            "no authentic answer; one without this key's tag came, from a run with another key or "
            "none, or from a forger: " +
                rig::clean_text(answers.without_tag->message, 300)};
  }
  if (!answer) {
    return {
        Outcome::no_answer,
        "no answer; check that abs_hil is running on this network (--lcm-url) and with this telemetry.channel_prefix"};
  }
  const auto reason = static_cast<rig::Reason>(answer->reason);
  const bool accepted = reason == rig::Reason::stop_command || rig::is_adjustment(reason);
  return {accepted ? Outcome::accepted : Outcome::refused, rig::clean_text(answer->message, 300), answers.has_key()};
}

}  // namespace

Reply send(const Order& order, const SenderOptions& options) {
  const bool is_stop = order.command == "stop";
  const std::string key = is_stop && options.key_file.empty() ? std::string() : read_key(options.key_file);
  telemetry::LcmOutlet outlet(options.url);
  lcm_t* const lcm = outlet.lcm().getUnderlyingLCM();
  const std::string sender = unique_sender();
  const std::string channel = options.channel_prefix + "COMMAND";
  Answers answers(outlet, options.channel_prefix, sender, key);
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.timeout_s));
  const auto answered = [&answers] { return answers.answer.has_value(); };
  if (is_stop) {
    command_t stop{};
    stop.command = "stop";
    stop.sender = sender;
    while (!answered() && Clock::now() < end) {
      publish(lcm, channel, stop);
      answers.wait(std::min(end, Clock::now() + stop_again), answered);
    }
    return reply_of(answers);
  }
  // A state has no tag, so none may end the sending.
  answers.wait(end, [&answers] { return answers.state.has_value(); });
  if (!answers.state && !answers.unusable.empty()) {
    return {Outcome::no_answer, "no authentic answer; ABS_COMMAND_STATE, which has no tag, " + answers.unusable};
  }
  if (!answers.state) return reply_of(answers);
  command_t command{};
  command.session = answers.state->session;
  command.sequence = answers.state->last_sequence + 1;
  command.command = order.command;
  command.name = order.name;
  command.value = order.value;
  command.sender = sender;
  command.mac = mac_of(command, key);
  answers.ending.reset();  // it may belong to an earlier run
  publish(lcm, channel, command);
  answers.wait(end, [&] { return answered() || answers.ending; });
  // The program publishes why the run ended before it refuses the pending commands.
  if (!answered() && answers.ending) answers.wait(std::min(end, Clock::now() + last_words), answered);
  if (!answered() && answers.ending) {
    return {Outcome::no_answer, "no answer, because the run ended: " + rig::clean_text(answers.ending->message, 200)};
  }
  return reply_of(answers);
}

}  // namespace abs_hil::commands
