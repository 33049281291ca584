#include "guardian/guardian_lease.hpp"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "abs_hil/driver/io_result.hpp"
#include "guardian/linux_process.hpp"

namespace abs_hil::guardian {

namespace {

/// The service may be busy with a board that does not answer.
constexpr int answers_within_ms = 20'000;
constexpr int covers_within_ms = 5'000;
constexpr int dismissed_within_ms = 500;

}  // namespace

std::unique_ptr<GuardianLease> GuardianLease::ask(const std::string& path, const std::string& board) {
  driver::FileDescriptor socket(connect_to(path));
  if (socket.get() < 0) {
    if (errno == ENOENT || errno == ECONNREFUSED) return nullptr;
    const std::string why = std::strerror(errno);
    refuse_run("cannot reach the resident service at " + path + ": " + why +
               (errno == EACCES ? "; join the group abs_hil and log in again" : "; correct guardian.socket"));
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
  return lease;
}

GuardianLease::~GuardianLease() { static_cast<void>(end()); }

void GuardianLease::cover(SharedRegion& region, std::string launch_config_json) {
  region_ = &region;
  launch_config_ = std::move(launch_config_json);
}

void GuardianLease::arm(const runtime::Scheduling& controller) {
  const driver::FileDescriptor launch_config(text_in_memory(launch_config_));
  if (region_ == nullptr || launch_config.get() < 0) refuse_run("cannot hand the run over to the resident service");
  if (!send_message(socket_.get(), {.word = LeaseWord::cover}, {region_->descriptor(), launch_config.get()})) {
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
  pollfd closed{socket_.get(), POLLRDHUP, 0};
  return ::poll(&closed, 1, 0) <= 0;
}

GuardEnd GuardianLease::end() noexcept {
  if (!std::exchange(armed_, false)) return GuardEnd::none;
  const bool handed_over = region_->stage() == Stage::handed_over;
  if (!handed_over) region_->set_stage(Stage::closed);
  try {
    const auto answer = receive_message(socket_.get(), dismissed_within_ms);
    if (answer && answer->word == LeaseWord::ended) return answer->safe ? GuardEnd::ended : GuardEnd::insisting;
  } catch (...) {
    return GuardEnd::failed;
  }
  return handed_over ? GuardEnd::insisting : GuardEnd::failed;
}

}  // namespace abs_hil::guardian
