// The run's side of a lease: it asks the resident service for the outputs, arms it and ends it.
#include "guardian/guardian_lease.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/linux_process.hpp"

namespace abs_hil::guardian {

namespace {

/// The service may be busy with a board that does not answer.
constexpr int answers_within_ms = 20'000;
constexpr int covers_within_ms = 5'000;
constexpr int dismissed_within_ms = 500;
constexpr int looks_every_ms = 1;

constexpr std::int64_t state_within_ns = 2000 * rig::ns_per_ms;
constexpr std::int64_t safe_within_ns = 300 * rig::ns_per_ms;

std::string why_not(int error) {
  if (error == EAGAIN) return "its queue of visitors is full";
  return std::string(std::strerror(error)) + (error == EACCES ? ": join the group abs_hil and log in again" : "");
}

std::optional<ServiceAnswer> call(const std::string& path, const LeaseMessage& message, std::int64_t within_ns) {
  const std::int64_t end_ns = driver::monotonic_ns() + within_ns;
  const driver::FileDescriptor socket(connect_to(path, within_ns));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return std::nullopt;
    return ServiceAnswer{.text = why_not(errno)};
  }
  ServiceAnswer said{.service = peer_of(socket.get()).pid,
                     .text = "it gave no answer within " + std::to_string(within_ns / rig::ns_per_ms) + " ms"};
  static_cast<void>(send_message(socket.get(), message));
  const std::int64_t left_ms = std::max<std::int64_t>(0, end_ns - driver::monotonic_ns()) / rig::ns_per_ms;
  if (const auto answer = receive_message(socket.get(), static_cast<int>(left_ms))) {
    said.answered = true;
    said.keeps_it = answer->word == LeaseWord::answer;
    said.safe = said.keeps_it && answer->safe;
    said.text = answer->text;
  }
  return said;
}

}  // namespace

std::unique_ptr<GuardianLease> GuardianLease::ask(const std::string& path, const std::string& board) {
  driver::FileDescriptor socket(connect_to(path));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return nullptr;
    const int error = errno;
    const std::string what = "cannot reach the resident service at " + path + ": ";
    if (error == EAGAIN) refuse_run(what + "it accepts no connection; end it and start it again");
    refuse_run(what + std::strerror(error) +
               (error == EACCES ? "; join the group abs_hil and log in again" : "; correct guardian.socket"));
  }
  const driver::FileDescriptor self(open_pidfd(::getpid()));
  if (self.get() < 0) refuse_run(std::string("cannot open a pidfd of this process: ") + std::strerror(errno));
  std::unique_ptr<GuardianLease> lease(new GuardianLease(std::move(socket)));
  // A service that refuses at once has closed its end already. Its answer is still to be read.
  static_cast<void>(send_message(lease->socket_.get(), {.word = LeaseWord::ask, .text = board}, {self.get()}));
  const auto answer = receive_message(lease->socket_.get(), answers_within_ms);
  const std::string service =
      "the resident service (process " + std::to_string(lease->service_.pid) + ", " + path + ") ";
  if (!answer) refuse_run(service + "gave no answer");
  if (answer->word != LeaseWord::granted) refuse_run(service + "refused a lease: " + answer->text);
  if (answer->files.size() != 2) refuse_run(service + "comes from another build of abs_hil");
  lease->pages_.emplace(Pages::as_run({answer->files[0].get(), answer->files[1].get()}));
  return lease;
}

GuardianLease::GuardianLease(driver::FileDescriptor socket)
    : socket_(std::move(socket)), service_(peer_of(socket_.get())), guard_process_(open_pidfd(service_.pid)) {}

GuardianLease::~GuardianLease() { static_cast<void>(end()); }

void GuardianLease::cover(const SharedRecorder& recorder, std::string launch_config_json) {
  recorder_ = &recorder;
  launch_config_ = std::move(launch_config_json);
}

void GuardianLease::arm(const runtime::Scheduling& controller) {
  const driver::FileDescriptor launch_config(text_in_memory(launch_config_));
  if (recorder_ == nullptr || launch_config.get() < 0) refuse_run("cannot hand the run over to the resident service");
  ends_before_ = pages_->guard().ends.load(std::memory_order_acquire);
  reset_page();
  if (!send_message(socket_.get(), {.word = LeaseWord::cover}, {recorder_->descriptor(), launch_config.get()})) {
    refuse_run(std::string("the resident service ended the lease: ") + std::strerror(errno));
  }
  const auto answer = receive_message(socket_.get(), covers_within_ms);
  if (!answer) refuse_run("the resident service ended the lease, or gave no answer");
  if (answer->word != LeaseWord::ready) refuse_run("the resident service does not guard this run: " + answer->text);
  armed_ = true;
  notes_ = answer->text;
  refuse_weaker(answer->scheduling, controller, "the service abs-guardian");
}

bool GuardianLease::alive() const noexcept {
  if (guard_process_.get() >= 0) return !has_ended(guard_process_.get());
  pollfd closed{socket_.get(), POLLRDHUP, 0};
  return ::poll(&closed, 1, 0) <= 0;
}

GuardEnd GuardianLease::end(Stage stage) noexcept {
  if (!std::exchange(armed_, false)) return GuardEnd::none;
  const bool handed_over = close_page(stage);
  const GuardPage& guard = pages_->guard();
  for (int waited_ms = 0; waited_ms < dismissed_within_ms && alive(); waited_ms += looks_every_ms) {
    if (guard.ends.load(std::memory_order_acquire) != ends_before_) {
      return guard.ended_safe.load(std::memory_order_relaxed) ? GuardEnd::ended : GuardEnd::insisting;
    }
    ::poll(nullptr, 0, looks_every_ms);
  }
  return handed_over && alive() ? GuardEnd::insisting : GuardEnd::failed;
}

std::optional<ServiceAnswer> service_state(const std::string& socket) {
  return call(socket, {.word = LeaseWord::state}, state_within_ns);
}

std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards) {
  return call(socket, {.word = LeaseWord::make_safe, .text = boards}, safe_within_ns);
}

}  // namespace abs_hil::guardian
