// The programs of the tests over a network: a paced publisher, a checking subscriber, a subscriber that counts what it
// lost, a checker of logs.
#include <poll.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <string>
#include <thread>

#include "commands/command_listener.hpp"
#include "commands/receiver.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_codec.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/sample_records.hpp"

namespace abs_hil::telemetry {
namespace {

/// Counts messages by channel and insists that each channel's sequence is consecutive from 0.
class SequenceChecker {
 public:
  void take(const std::string& channel, const void* data, std::uint32_t size) {
    const std::int64_t expected = count_[channel]++;
    if (channel == "ABS_TELEMETRY") check<telemetry_t>(channel, data, size, expected);
    if (channel == "ABS_STATUS") check<status_t>(channel, data, size, expected);
    if (channel == "ABS_EVENT") check<event_t>(channel, data, size, expected);
    if (channel == "ABS_EXPERIMENT") check<experiment_t>(channel, data, size, expected);
  }
  [[nodiscard]] std::int64_t telemetry_count() const {
    const auto found = count_.find("ABS_TELEMETRY");
    return found == count_.end() ? 0 : found->second;
  }
  /// Prints the counts; true if all is well and `telemetry_count` messages of telemetry came.
  [[nodiscard]] bool verdict(std::int64_t telemetry_expected) const {
    for (const auto& [channel, count] : count_)
      std::printf("%s %lld  ", channel.c_str(), static_cast<long long>(count));
    const bool complete = telemetry_count() == telemetry_expected && count_.size() >= 4;
    std::printf("%s\n", faults_ != 0 ? "OUT OF SEQUENCE" : complete ? "ok" : "INCOMPLETE");
    return faults_ == 0 && complete;
  }

 private:
  template <class Message>
  void check(const std::string& channel, const void* data, std::uint32_t size, std::int64_t expected) {
    Message message{};
    const bool sound = message.decode(data, 0, static_cast<int>(size)) == static_cast<int>(size);
    if (sound && message.sequence == expected) return;
    if (faults_++ < 5) {
      std::fprintf(stderr, "%s: expected sequence %lld, got %lld\n", channel.c_str(), static_cast<long long>(expected),
                   sound ? static_cast<long long>(message.sequence) : -1LL);
    }
  }
  std::map<std::string, std::int64_t> count_;
  int faults_{0};
};

int publish(const std::string& url, std::uint64_t count, int period_us, const char* log_path) {
  LcmOutlet outlet(url);
  LogOutlet log(log_path);
  MessageStream stream({}, {{0, 0, "paper", "adaptive", "paper-table1", "sim", "{}", "0.1.0"}}, {});
  stream.add(outlet);
  stream.add(log);
  commands::CommandListener listener(outlet, stream, {});
  const auto start = std::chrono::steady_clock::now();
  auto wake_up = start;
  std::uint64_t sent = 0;
  for (; sent < count && !listener.stop_requested(); ++sent) {
    stream.consume(test::sample_record(sent), 0.0);
    if (sent % 10 == 0) listener.poll();
    std::this_thread::sleep_until(wake_up += std::chrono::microseconds(period_us));
  }
  stream.finish();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  std::printf("published %llu in %.3f s, failures %llu, stops %llu\n", static_cast<unsigned long long>(sent),
              elapsed.count(), static_cast<unsigned long long>(outlet.failures()),
              static_cast<unsigned long long>(listener.counts().stops));
  return outlet.failures() == 0 ? 0 : 1;
}

int subscribe(const std::string& url, std::int64_t count) {
  lcm::LCM lcm(url);
  if (!lcm.good()) return 3;
  SequenceChecker checker;
  const auto on_message = [](const lcm_recv_buf_t* received, const char* channel, void* to) {
    static_cast<SequenceChecker*>(to)->take(channel, received->data, received->data_size);
  };
  auto* subscription = lcm_subscribe(lcm.getUnderlyingLCM(), "ABS_.*", on_message, &checker);
  lcm_subscription_set_queue_capacity(subscription, 0);
  pollfd ready{lcm.getFileno(), POLLIN, 0};
  // Until nothing has come for 2 s; 20 s for the first.
  while (::poll(&ready, 1, checker.telemetry_count() == 0 ? 20'000 : 2'000) > 0) lcm.handle();
  return checker.verdict(count) ? 0 : 1;
}

/// Counts telemetry by its sequence numbers, as one who shows or keeps it would.
class LossCounter {
 public:
  void take(const std::string& channel, std::span<const std::uint8_t> packet) {
    if (channel == "ABS_TELEMETRY") {
      telemetry_t message{};
      if (!decode_checked(packet, message).empty()) {
        ++malformed;
        return;
      }
      ++received;
      if (message.sequence < next) return;  // late: counted as lost before
      lost += message.sequence - next;
      next = message.sequence + 1;
    }
    if (channel == "ABS_STATUS") {
      subscribed = decode_checked(packet, status).empty() || subscribed;
    }
  }

  std::int64_t received{0};
  std::int64_t next{0};
  std::int64_t lost{0};
  std::int64_t malformed{0};
  status_t status{};
  bool subscribed{false};
};

/// A tcpq server hears of a subscription when its thread comes to it, up to some 0.1 s later. Waits until it hands on
/// what another client publishes. False if that does not come within 10 s.
bool await_subscription(const std::string& url, commands::Receiver& listener, const LossCounter& counter) {
  lcm::LCM other(url);
  const status_t message{};
  for (int tries = 0; tries < 1'000 && !counter.subscribed; ++tries) {
    if (other.publish("ABS_STATUS", &message) != 0) return false;
    pollfd ready{listener.file_descriptor(), POLLIN, 0};
    if (::poll(&ready, 1, 10) > 0) listener.poll();
  }
  return counter.subscribed;
}

/// Until nothing has come for `silence_s`, 30 s for the first.
int receive(const std::string& url, int silence_s) {
  LossCounter counter;
  commands::Receiver listener(url, "ABS_(TELEMETRY|STATUS|EVENT|EXPERIMENT)",
                              [&](const std::string& channel, auto packet) { counter.take(channel, packet); });
  if (url.starts_with("tcpq:") && !await_subscription(url, listener, counter)) {
    std::fprintf(stderr, "the server of %s does not hand on what is published\n", url.c_str());
    return 3;
  }
  std::printf("listening\n");
  std::fflush(stdout);
  const auto now = [] { return std::chrono::steady_clock::now(); };
  auto end = now() + std::chrono::seconds(30);
  while (now() < end) {
    pollfd ready{listener.file_descriptor(), POLLIN, 0};
    if (::poll(&ready, 1, 100) > 0 || ready.fd < 0) {
      const std::int64_t before = counter.received;
      listener.poll();
      if (counter.received != before) end = now() + std::chrono::seconds(silence_s);
    }
  }
  std::printf(R"({"received": %lld, "lost": %lld, "malformed": %lld, "run_drops": %lld, "run_failures": %lld})"
              "\n",
              static_cast<long long>(counter.received), static_cast<long long>(counter.lost),
              static_cast<long long>(counter.malformed), static_cast<long long>(counter.status.telemetry_drops),
              static_cast<long long>(counter.status.publish_failures));
  return 0;
}

int check_log(const std::string& path, std::int64_t count) {
  lcm::LogFile log(path, "r");
  if (!log.good()) return 3;
  SequenceChecker checker;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    checker.take(event->channel, event->data, static_cast<std::uint32_t>(event->datalen));
  }
  return checker.verdict(count) ? 0 : 1;
}

int command(const std::string& url, const char* text) {
  lcm::LCM lcm(url);
  command_t message{};
  message.command = text;
  message.sender = "network_test";
  return lcm.good() && lcm.publish("ABS_COMMAND", &message) == 0 ? 0 : 1;
}

int run(int argc, char** argv) {
  const std::string verb = argc > 1 ? argv[1] : "";
  const std::string url_or_path = argc > 2 ? argv[2] : "";
  if (verb == "publish" && argc == 6) {
    return publish(url_or_path, std::strtoull(argv[3], nullptr, 10), std::atoi(argv[4]), argv[5]);
  }
  if (verb == "subscribe" && argc == 4) return subscribe(url_or_path, std::atoll(argv[3]));
  if (verb == "receive" && argc == 4) return receive(url_or_path, std::atoi(argv[3]));
  if (verb == "check-log" && argc == 4) return check_log(url_or_path, std::atoll(argv[3]));
  if (verb == "command" && argc == 4) return command(url_or_path, argv[3]);
  std::fprintf(
      stderr,
      "usage: publish URL COUNT PERIOD_US LOG | subscribe URL COUNT | receive URL SILENCE_S | check-log PATH COUNT | "
      "command URL TEXT\n");
  return 2;
}

}  // namespace
}  // namespace abs_hil::telemetry

int main(int argc, char** argv) {
  try {
    return abs_hil::telemetry::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
