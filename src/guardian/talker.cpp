// Talks with the service's clients, so that the guard itself never waits for one.
#include "guardian/talker.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <sstream>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "guardian/linux_process.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::size_t most_clients = 64;
constexpr std::int64_t speaks_within_ns = 2'000'000'000;
constexpr std::size_t longest_shown = 500;  ///< of a client's own words
constexpr short closed_events = POLLHUP | POLLRDHUP | POLLERR | POLLNVAL;

/// One that does not take it is gone, or is dropped later.
void send_to(const TalkerClient& client, const LeaseMessage& message) {
  static_cast<void>(send_message(client.socket.get(), message));
}

bool names(const std::string& boards, const std::string& board) {
  std::istringstream lines(boards);
  for (std::string line; std::getline(lines, line);) {
    if (line == board) return true;
  }
  return false;
}

std::string words_of(Refusal why, const News& news) {
  switch (why) {
    case Refusal::former_lives:
      return "process " + std::to_string(news.former_pid) + " of an earlier run has not ended yet";
    case Refusal::not_safe: return "the board cannot be made safe: " + driver::error_text(news.board);
    case Refusal::cannot_end_it:
      return "the service could not end that process: run it as the same user, or the service as root";
    case Refusal::no_memory: return "the service has no memory left for it";
    case Refusal::too_late: return "it did not have a run covered in time";
    case Refusal::held:
    case Refusal::none: break;
  }
  return "the guard is busy; try again";
}

}  // namespace

void Talker::step(int timeout_ms) {
  parts_.page.talker_beats.fetch_add(1, std::memory_order_relaxed);
  const int pause = parts_.pause != nullptr ? parts_.pause->descriptor() : -1;
  std::vector<pollfd> files{
      {parts_.listener, POLLIN, 0}, {parts_.mail.news_descriptor(), POLLIN, 0}, {pause, POLLIN, 0}};
  const std::size_t first_client = files.size();
  for (const Client& client : clients_) files.push_back({client.socket.get(), POLLIN | POLLRDHUP, 0});
  if (!outbox_.empty()) timeout_ms = std::min(timeout_ms, 1);
  if (::poll(files.data(), files.size(), timeout_ms) < 0 && errno != EINTR) return;

  hear_guard();  // first: what a client says may answer it
  const std::size_t heard = clients_.size();
  for (std::size_t n = 0; n < heard && first_client + n < files.size(); ++n) {
    Client& client = clients_[n];
    const short events = files[first_client + n].revents;
    if ((events & POLLIN) != 0) {
      hear(client);
    } else if ((events & closed_events) != 0) {
      drop(client);
    }
  }
  const std::int64_t now_ns = parts_.clock.now_ns();
  for (Client& client : clients_) {
    if (is_silent(client) && now_ns - client.since_ns > speaks_within_ns) drop(client);
  }
  std::erase_if(clients_, [](const Client& client) { return client.gone; });
  if (files[2].revents != 0) {  // the guard knows of the pause; it need only look
    parts_.pause->take();
    order({.word = OrderWord::look});
  }
  if (files[0].revents != 0) accept_clients();
  ask_guard_for_next();
  while (!outbox_.empty() && now_ns >= next_look_ns_ && parts_.mail.order(outbox_.front())) {
    if (outbox_.front().word == OrderWord::look) next_look_ns_ = now_ns + rig::ns_per_ms;
    outbox_.erase(outbox_.begin());
  }
}

/// Takes all that wait, so that no queue of silent ones keeps others out. Of too many, the longest silent one goes.
void Talker::accept_clients() {
  for (std::size_t n = 0; n < most_clients; ++n) {
    driver::FileDescriptor socket(::accept4(parts_.listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (socket.get() < 0) return;
    if (clients_.size() >= most_clients) {
      const auto silent = std::ranges::find_if(clients_, [this](const Client& client) { return is_silent(client); });
      if (silent == clients_.end()) return;
      clients_.erase(silent);
    }
    clients_.push_back({.socket = std::move(socket), .since_ns = parts_.clock.now_ns()});
  }
}

Talker::Client* Talker::client_of(int socket) {
  const auto found =
      std::ranges::find_if(clients_, [socket](const Client& c) { return !c.gone && c.socket.get() == socket; });
  return found == clients_.end() ? nullptr : &*found;
}

void Talker::drop(Client& client) {
  if (holds(client)) close_holder();
  if (asking_ == client.socket.get()) asking_ = -1;
  client.gone = true;
}

void Talker::close_holder() {
  held_->socket = -1;
  order({.word = OrderWord::close, .lease = held_->lease});
}

/// One that waits already is not put in again: a flood of requests must not grow the outbox.
void Talker::order(const Order& order) {
  if (std::ranges::find(outbox_, order) == outbox_.end()) outbox_.push_back(order);
}

void Talker::hear(Client& client) {
  auto said = receive_message(client.socket.get(), 0);
  if (!said) return drop(client);
  switch (said->word) {
    case LeaseWord::state: return answer_state(client);
    case LeaseWord::make_safe: return ask_for_safe(client, *said);
    case LeaseWord::ask: return take_request(client, *said);
    default: break;
  }
  if (holds(client) && said->word == LeaseWord::cover) return cover(client, *said);
  drop(client);
}

std::string Talker::outputs_text() const {
  return latest_.board.ok() ? "drive 0 and brake 0 written and read back"
                            : "OUTPUTS NOT SAFE: " + driver::error_text(latest_.board);
}

void Talker::answer_state(const Client& client) {
  LeaseMessage said{.word = LeaseWord::answer, .safe = latest_.safe, .text = "nobody has its lease; " + outputs_text()};
  if (held_) {
    said = {.word = LeaseWord::answer, .text = held_->name + " has its lease"};
  } else if (latest_.former_pid != 0) {
    said.text =
        "process " + std::to_string(latest_.former_pid) + ", which had its lease, has not ended yet; " + outputs_text();
  }
  said.text = parts_.board + ": " + said.text;
  send_to(client, said);
}

void Talker::ask_for_safe(Client& client, const LeaseMessage& said) {
  if (!names(said.text, parts_.board)) {
    send_to(client, {.word = LeaseWord::refused, .text = parts_.board});
    return;
  }
  client.waits_for_safe = true;
  if (held_) order({.word = OrderWord::take_back, .reason = rig::Reason::made_safe_on_request});
  if (!held_) order({.word = OrderWord::look});
}

void Talker::answer_safe_callers(const std::string& what) {
  for (Client& client : clients_) {
    if (!std::exchange(client.waits_for_safe, false)) continue;
    send_to(client, {.word = LeaseWord::answer, .safe = latest_.safe, .text = parts_.board + ": " + what});
  }
}

void Talker::refuse(Client& client, const std::string& why) {
  send_to(client, {.word = LeaseWord::refused, .text = why});
  client.asks = false;
  client.gone = true;
}

std::string Talker::why_no_lease(const LeaseMessage& asked, const Peer& peer) const {
  if (peer.pid <= 0) return "the pidfd is not that of the process that asks";
  if (asked.text != parts_.board) {
    return "it keeps " + parts_.board + ", and the run wants " + rig::clean_text(asked.text, longest_shown) +
           "; name that board's service with guardian.socket, or give both the same driver.* keys";
  }
  return {};
}

void Talker::take_request(Client& client, LeaseMessage& asked) {
  if (client.asks || holds(client)) return drop(client);
  // One that has the lease and is still connected keeps it. Otherwise it is about to end.
  if (held_ && held_->socket >= 0) {
    return refuse(client, held_->name + " has the lease, and there is only one at a time; end that run first");
  }
  auto& files = asked.files;
  if (files.size() == 1) client.peer = parts_.identify(client.socket.get(), files.front().get());
  if (const std::string why =
          files.size() == 1 ? why_no_lease(asked, client.peer) : "not a request of this build of abs_hil";
      !why.empty()) {
    parts_.tell("refused a lease to " + name_of_process(peer_of(client.socket.get()).pid) + ": " + why);
    return refuse(client, why);
  }
  client.pidfd = std::move(files.front());
  client.asks = true;
}

/// The guard is asked for one client at a time, once nobody has the lease.
void Talker::ask_guard_for_next() {
  if (held_ || asking_ >= 0) return;
  const auto next = std::ranges::find_if(clients_, [](const Client& client) { return client.asks && !client.gone; });
  if (next == clients_.end()) return;
  asking_ = next->socket.get();
  order({.word = OrderWord::grant, .pid = next->peer.pid});
}

void Talker::cover(Client& client, const LeaseMessage& message) {
  try {
    if (message.files.size() != 2) throw std::runtime_error("not a request of this build of abs_hil");
    LeaseTerms terms = parts_.read_terms(text_behind(message.files[1].get()), held_->peer);
    if (terms.board != parts_.board) {
      throw std::runtime_error("the lease is of " + parts_.board + ", the run drives " + terms.board);
    }
    held_->recorder.emplace(SharedRecorder::attach(message.files[0].get()));
    held_->terms = std::move(terms);
    order({.word = OrderWord::cover, .lease = held_->lease, .timeout_ns = held_->terms.timeout_ns});
  } catch (const std::exception& error) {
    const std::string why = rig::clean_text(error.what(), longest_shown);  // it may quote what the client sent
    parts_.tell("does not guard " + held_->name + ": " + why);
    send_to(client, {.word = LeaseWord::refused, .text = why});
  }
}

void Talker::hear_guard() {
  News news;
  std::vector<driver::FileDescriptor> pages;
  while (parts_.mail.next(news, pages)) take_news(news, std::exchange(pages, {}));
}

void Talker::take_news(const News& news, const std::vector<driver::FileDescriptor>& pages) {
  const driver::IoError before = std::exchange(latest_, news).board.error;
  if (!std::exchange(knows_board_, true) || before != news.board.error) {
    parts_.tell(parts_.board + ": " + outputs_text() + (news.board.ok() ? "" : "; tries on"));
  }
  const bool of_held = held_ && held_->lease == news.lease;
  Client* const holder = of_held ? client_of(held_->socket) : nullptr;
  switch (news.word) {
    case NewsWord::board: break;
    case NewsWord::looked:
      if (!held_) answer_safe_callers("nobody has its lease; " + outputs_text());
      break;
    case NewsWord::granted: give_lease(news, pages); break;
    case NewsWord::refused:
      if (holder != nullptr) {
        send_to(*holder, {.word = LeaseWord::refused, .text = "its lease has ended, or covers a run already"});
      } else if (Client* const client = client_of(std::exchange(asking_, -1)); client != nullptr) {
        const std::string why = words_of(news.why, news);
        parts_.tell("refused a lease to " + name_of_process(client->peer.pid) + ": " + why);
        refuse(*client, why);
      }
      break;
    case NewsWord::covered:
      if (holder == nullptr) break;
      send_to(*holder, {.word = LeaseWord::ready, .scheduling = parts_.scheduling, .text = parts_.shortcomings});
      break;
    case NewsWord::acted: {
      if (!of_held) break;
      const std::string account = to_text(news.report, held_->peer.pid);
      parts_.tell(account.substr(0, account.find_last_not_of('\n') + 1));
      if (held_->terms.write_record && held_->recorder)
        held_->terms.write_record(*held_->recorder, news.report, account);
      break;
    }
    case NewsWord::ended: break;  // the run reads it in the guard's page
    case NewsWord::over:
      if (of_held) end_lease(news);
      break;
  }
  parts_.status(held_ ? "lease: " + held_->name : news.safe ? "no lease, outputs 0" : "no lease, OUTPUTS NOT VERIFIED");
}

void Talker::give_lease(const News& news, const std::vector<driver::FileDescriptor>& pages) {
  Client* const client = client_of(std::exchange(asking_, -1));
  // The guard opened the process by its number. The client's own handle tells that it is still the same.
  const bool lives =
      client != nullptr && pages.size() == 2 && parts_.identify(client->socket.get(), client->pidfd.get()).pid != 0;
  held_.emplace();
  held_->lease = news.lease;
  if (client != nullptr) {
    held_->peer = client->peer;
    held_->name = name_of_process(client->peer.pid);
    client->asks = false;
  }
  if (!lives || !send_message(client->socket.get(), {.word = LeaseWord::granted}, {pages[0].get(), pages[1].get()})) {
    return close_holder();
  }
  held_->socket = client->socket.get();
  if (parts_.pause != nullptr) parts_.pause->set_leased(true);
  parts_.tell("lease granted to " + held_->name);
}

void Talker::end_lease(const News& news) {
  const std::string name = held_->name;
  if (Client* const holder = client_of(held_->socket)) holder->gone = true;
  held_.reset();
  if (parts_.pause != nullptr) parts_.pause->set_leased(false);
  if (news.why != Refusal::none) parts_.tell("ended " + name + ": " + words_of(news.why, news));
  parts_.tell("lease ended: " + name);
  answer_safe_callers("ended the lease of " + name);
}

}  // namespace abs_hil::guardian
