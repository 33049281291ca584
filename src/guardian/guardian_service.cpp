#include "guardian/guardian_service.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "guardian/linux_process.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::int64_t retry_ns = 100'000'000;
constexpr std::int64_t alive_ns = 100'000'000;
constexpr int asks_within_ms = 200;
/// How long a lease's own loop tries to verify the safe state. Then the service goes on, and never gives up.
constexpr double first_tries_s = 0.2;

std::string command_of(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/comm");
  std::string name;
  std::getline(file, name);
  return "process " + std::to_string(pid) + (name.empty() ? "" : " (" + name + ")");
}

}  // namespace

/// The client as GuardianLoop sees it. While the loop waits, the service attends to everything else.
class GuardianService::Holder final : public ControllerProcess {
 public:
  explicit Holder(GuardianService& service) noexcept : service_(service), process_(service.client_->pidfd.get()) {}

  [[nodiscard]] bool gone_by(std::int64_t time_ns) noexcept override {
    Client& client = *service_.client_;
    while (!client.gone) {
      const rig::Reason before = service_.pending_;
      const Woken woken = service_.wait(time_ns);
      // A client that drives has nothing to say.
      if (woken.spoke) client.closed = true;
      if (before != service_.pending_ || service_.clock_.now_ns() >= time_ns) break;
    }
    return client.gone;
  }
  void end() noexcept override { process_.end(); }
  [[nodiscard]] rig::Reason must_give_back_for() noexcept override {
    if (service_.pending_ != rig::Reason::none) return service_.pending_;
    return service_.client_->closed ? rig::Reason::lease_closed : rig::Reason::none;
  }

 private:
  GuardianService& service_;
  LinuxProcess process_;
};

GuardianService::GuardianService(runtime::Clock& clock, ServiceParts parts) : clock_(clock), parts_(std::move(parts)) {}

GuardianService::~GuardianService() = default;

void GuardianService::start() { keep(); }

bool GuardianService::run() {
  while (!ending_) {
    if (interrupted_ || clock_.now_ns() >= next_keep_ns_) {
      keep();
      deal_with_interruptions();
      continue;
    }
    if (wait(next_keep_ns_).visitor) receive_visitor();
  }
  keep();
  return safe_;
}

/// Waits until something happens, `until_ns` at the latest. Turns further visitors away while there is a client.
GuardianService::Woken GuardianService::wait(std::int64_t until_ns) {
  constexpr short closed_events = POLLHUP | POLLRDHUP | POLLERR;
  const std::int64_t now_ns = clock_.now_ns();
  if (now_ns >= next_alive_ns_) {
    parts_.alive();
    next_alive_ns_ = now_ns + alive_ns;
  }
  // A descriptor of -1 is left out.
  constexpr std::size_t own_files = 4;
  std::array<pollfd, own_files + 8> files{};
  files[0] = {parts_.listener.get(), POLLIN, 0};
  files[1] = {client_ && !client_->gone ? client_->pidfd.get() : -1, POLLIN, 0};
  files[2] = {client_ && !client_->closed ? client_->socket.get() : -1, POLLIN | POLLRDHUP, 0};
  files[3] = {caller_.get(), POLLIN | POLLRDHUP, 0};
  std::size_t count = own_files;
  for (const Interruption& i : parts_.interruptions) files.at(count++) = {i.descriptor, POLLIN, 0};

  const std::int64_t left_ns = std::clamp<std::int64_t>(std::min(until_ns, next_alive_ns_) - now_ns, 0, alive_ns);
  const timespec left{.tv_sec = 0, .tv_nsec = left_ns};
  if (::ppoll(files.data(), count, &left, nullptr) <= 0) return {};
  Woken woken;
  if (client_ && files[1].revents != 0) client_->gone = true;
  if (client_ && (files[2].revents & POLLIN) != 0) woken.spoke = true;
  if (client_ && !woken.spoke && (files[2].revents & closed_events) != 0) client_->closed = true;
  for (std::size_t i = own_files; i < count; ++i) {
    if (files.at(i).revents == 0) continue;
    const rig::Reason why = parts_.interruptions[i - own_files].take();
    if (pending_ == rig::Reason::none) pending_ = why;
    if (why == rig::Reason::guardian_told_to_end) ending_ = true;
    interrupted_ = true;
  }
  if (files[3].revents != 0) hear_caller();
  if ((files[0].revents & POLLIN) != 0) {
    if (client_) {
      receive_caller();
    } else {
      woken.visitor = true;
    }
  }
  return woken;
}

/// Somebody else connects while a client has the lease. The service does not wait for his words: it looks after the
/// outputs. Only the last one who has not spoken yet is kept.
void GuardianService::receive_caller() {
  caller_ = driver::FileDescriptor(::accept4(parts_.listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (caller_.get() >= 0) hear_caller();
}

void GuardianService::hear_caller() {
  pollfd spoke{caller_.get(), POLLIN | POLLRDHUP, 0};
  if (::poll(&spoke, 1, 0) == 0) return;
  const driver::FileDescriptor caller = std::move(caller_);
  caller_ = driver::FileDescriptor(-1);
  const auto said = receive_message(caller.get(), 0);
  if (!said) return;
  if (said->word == LeaseWord::make_safe && client_ && keeps_one_of(said->text)) {
    if (pending_ == rig::Reason::none) pending_ = rig::Reason::made_safe_on_request;
    safe_caller_ = driver::FileDescriptor(::fcntl(caller.get(), F_DUPFD_CLOEXEC, 0));
    return;
  }
  if (answer(caller.get(), *said)) return;
  static_cast<void>(send_message(caller.get(), {.word = LeaseWord::refused,
                                                .text = command_of(client_->peer.pid) +
                                                        " has the lease, and there is only one at a time; end that "
                                                        "run first"}));
}

bool GuardianService::keeps_one_of(const std::string& boards) const {
  std::istringstream lines(boards);
  for (std::string line; std::getline(lines, line);) {
    if (line == parts_.board) return true;
  }
  return false;
}

bool GuardianService::answer(int socket, const LeaseMessage& asked) {
  if (asked.word != LeaseWord::state && asked.word != LeaseWord::make_safe) return false;
  const std::string outputs = board_result_.ok() ? "drive 0 and brake 0 written and read back"
                                                 : "OUTPUTS NOT SAFE: " + driver::error_text(board_result_);
  LeaseMessage said{.word = LeaseWord::answer, .safe = safe_, .text = "nobody has its lease; " + outputs};
  if (asked.word == LeaseWord::make_safe && !keeps_one_of(asked.text)) {
    said = {.word = LeaseWord::refused};
  } else if (client_) {
    said = {.word = LeaseWord::answer, .text = command_of(client_->peer.pid) + " has its lease"};
  } else if (!safe_ && board_result_.ok()) {
    said.text = "process " + std::to_string(former_pid_) + ", which had its lease, has not ended yet; " + outputs;
  }
  said.text = parts_.board + (said.text.empty() ? "" : ": ") + said.text;
  static_cast<void>(send_message(socket, said));
  return true;
}

void GuardianService::answer_safe_caller(const std::string& holder) {
  if (pending_ == rig::Reason::made_safe_on_request) pending_ = rig::Reason::none;
  if (safe_caller_.get() < 0) return;
  static_cast<void>(send_message(
      safe_caller_.get(),
      {.word = LeaseWord::answer, .safe = safe_, .text = parts_.board + ": ended the lease of " + holder}));
  safe_caller_ = driver::FileDescriptor(-1);
}

std::string GuardianService::why_no_lease(const LeaseMessage& asked, const Peer& peer) {
  if (asked.word != LeaseWord::ask || asked.files.size() != 1) return "not a request of this build of abs_hil";
  const int pidfd = asked.files.front().get();
  if (process_of(pidfd) != peer.pid || peer.pid <= 0) return "the pidfd is not that of the process that asks";
  if (!send_signal(pidfd, 0)) {
    return "the service could not end that process (" + std::string(std::strerror(errno)) +
           "): run it as the same user, or the service as root";
  }
  if (asked.text != parts_.board) {
    return "it keeps " + parts_.board + ", and the run wants " + asked.text +
           "; name that board's service with guardian.socket, or give both the same driver.* keys";
  }
  for (const Interruption& i : parts_.interruptions) {
    if (const std::string why = i.bars_leases ? i.bars_leases() : std::string(); !why.empty()) return why;
  }
  if (!former_client_gone()) return "process " + std::to_string(former_pid_) + " of an earlier run has not ended yet";
  if (!safe_) return "the board cannot be made safe: " + driver::error_text(board_result_);
  return {};
}

void GuardianService::receive_visitor() {
  driver::FileDescriptor socket(::accept4(parts_.listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (socket.get() < 0) return;
  auto asked = receive_message(socket.get(), asks_within_ms);
  if (!asked) return;
  keep();  // nobody gets a lease on outputs that are not known to be zero now
  if (answer(socket.get(), *asked)) return;
  const Peer peer = peer_of(socket.get());
  if (const std::string why = why_no_lease(*asked, peer); !why.empty()) {
    parts_.tell("refused a lease to " + command_of(peer.pid) + ": " + why);
    static_cast<void>(send_message(socket.get(), {.word = LeaseWord::refused, .text = why}));
    return;
  }
  serve({.socket = std::move(socket), .pidfd = std::move(asked->files.front()), .peer = peer});
}

void GuardianService::serve(Client client) {
  client_ = std::make_unique<Client>(std::move(client));
  const std::string name = command_of(client_->peer.pid);
  writer_.reset();  // lets go of the board
  tell_lease(true);
  parts_.status("lease: " + name);
  parts_.tell("lease granted to " + name);
  if (!send_message(client_->socket.get(), {.word = LeaseWord::granted})) client_->closed = true;
  while (!client_->gone && !client_->closed && pending_ == rig::Reason::none) {
    if (!wait(clock_.now_ns() + alive_ns).spoke) continue;
    const auto message = receive_message(client_->socket.get(), 0);
    if (!message || message->word != LeaseWord::cover) break;
    cover(*message);
  }
  client_.reset();
  tell_lease(false);
  keep();
  parts_.tell("lease ended: " + name);
  answer_safe_caller(name);
  deal_with_interruptions();
}

void GuardianService::cover(const LeaseMessage& message) {
  const auto refuse = [this](const std::string& why) {
    writer_.reset();
    parts_.tell("does not guard " + command_of(client_->peer.pid) + ": " + why);
    static_cast<void>(send_message(client_->socket.get(), {.word = LeaseWord::refused, .text = why}));
  };
  try {
    if (message.files.size() != 2) return refuse("not a request of this build of abs_hil");
    SharedRegion region = SharedRegion::attach(message.files[0].get());
    LeaseTerms terms = parts_.read_terms(text_behind(message.files[1].get()), client_->peer);
    if (terms.board != parts_.board)
      return refuse("the lease is of " + parts_.board + ", the run drives " + terms.board);
    writer_ = parts_.make_writer();
    writer_->prepare();
    terms.options.insist_s = std::min(terms.options.insist_s, first_tries_s);

    Holder holder(*this);
    GuardianLoop loop(clock_, holder, region, *writer_, terms.options);
    if (!send_message(client_->socket.get(),
                      {.word = LeaseWord::ready, .scheduling = parts_.scheduling, .text = parts_.shortcomings})) {
      client_->closed = true;
    }
    const GuardianReport report = loop.run();
    if (report.acted && !report.controller_lives && !client_->gone) {
      former_ = std::move(client_->pidfd);
      former_pid_ = client_->peer.pid;
      client_->closed = true;
    }
    const bool safe = !report.acted || report.verified;
    static_cast<void>(send_message(client_->socket.get(), {.word = LeaseWord::ended, .safe = safe}));
    if (report.reason == rig::Reason::none) {
      writer_.reset();
      return;
    }
    // The outputs are dealt with, or the service goes on with them: the rest need not be real-time safe.
    const std::string account = to_text(report, client_->peer.pid);
    parts_.tell(account.substr(0, account.find_last_not_of('\n') + 1));
    if (terms.write_record) terms.write_record(region, report, account);
    if (!report.controller_lives) client_->gone = true;
  } catch (const std::exception& error) {
    refuse(error.what());
  }
}

bool GuardianService::former_client_gone() {
  if (former_.get() < 0) return true;
  LinuxProcess former(former_.get());
  if (!former.gone_by(clock_.now_ns())) return false;
  former_ = driver::FileDescriptor(-1);
  return true;
}

/// Makes the outputs safe, verifies it, and tells changes.
void GuardianService::keep() {
  driver::IoResult result{driver::IoError::disconnected};
  try {
    if (!writer_) writer_ = parts_.make_writer();
    result = writer_->make_safe();
  } catch (const std::exception& error) {
    if (!std::exchange(board_known_, true)) parts_.tell(error.what());
  }
  const bool changed = !std::exchange(board_known_, true) || result.error != board_result_.error;
  board_result_ = result;
  safe_ = result.ok() && former_client_gone();
  if (changed) {
    const std::string words = result.ok() ? "drive 0 and brake 0 written and read back"
                                          : "NOT SAFE: " + driver::error_text(result) + "; tries on";
    parts_.tell(parts_.board + ": " + words);
  }
  parts_.status(safe_ ? "no lease, outputs 0" : "no lease, OUTPUTS NOT VERIFIED");
  next_keep_ns_ = clock_.now_ns() + (safe_ ? parts_.keep_ns : retry_ns);
}

void GuardianService::tell_lease(bool held) {
  for (const Interruption& i : parts_.interruptions) {
    if (i.lease_changed) i.lease_changed(held);
  }
}

void GuardianService::deal_with_interruptions() {
  if (!std::exchange(interrupted_, false)) return;
  pending_ = rig::Reason::none;
  for (const Interruption& i : parts_.interruptions) {
    if (i.dealt_with) i.dealt_with(safe_);
  }
}

}  // namespace abs_hil::guardian
