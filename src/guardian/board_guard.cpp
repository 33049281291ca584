// The guard's looks: grant, cover, watch, act, give up. See board_guard.hpp for the states.
#include "guardian/board_guard.hpp"

#include <algorithm>
#include <utility>

namespace abs_hil::guardian {

namespace {

using rig::Reason;

constexpr int most_orders_a_look = 8;
/// From the grant to the first cover: the run opens its board meanwhile.
constexpr std::int64_t cover_within_ns = 10'000'000'000;
/// A killed process ends within microseconds unless the kernel is still executing one of its accesses.
constexpr std::int64_t end_wait_ns = 5'000'000;
constexpr int quick_tries = 100;
constexpr std::int64_t quick_pause_ns = 1'000'000;
constexpr std::int64_t slow_pause_ns = 10'000'000;
constexpr std::int64_t last_tries_ns = 1'000'000'000;
constexpr int looks_to_believe = 2;
/// A board may show nothing for this long, as after a lost datagram. Then its outputs count as given to the guard.
constexpr std::int64_t blind_most_ns = 100'000'000;
/// A holder whose board shows duties again and again drives it without being watched. A single one may be another's.
constexpr int foreign_duty_weighs = 2;
constexpr int foreign_duties_most = 12;
constexpr std::int64_t foreign_forgotten_ns = 60'000'000'000;
/// A look between the index and the data of an access of the run's would spoil that access, so looks begin after the
/// run has had the time to take over its outputs.
constexpr std::int64_t takes_over_within_ns = 15'000'000;
/// A board of one owner is free this long after its owner was done with it, or the owner is ended.
constexpr std::int64_t frees_board_within_ns = 1'000'000'000;

/// Eight looks per timeout. Silence is therefore noticed at most an eighth of the timeout late.
std::int64_t look_period_for(std::int64_t timeout_ns) noexcept {
  constexpr std::int64_t shortest_ns = 250'000;
  constexpr std::int64_t longest_ns = 5'000'000;
  return std::clamp(timeout_ns / 8, shortest_ns, longest_ns);
}

}  // namespace

void BoardGuard::begin() noexcept {
  now_ns_ = parts_.clock.now_ns();
  look_at_board();
}

void BoardGuard::cover_only(Pages pages, int handle) noexcept {
  pages_.emplace(std::move(pages));
  handle_ = handle;
  cover(parts_.timeout_ns);
}

void BoardGuard::look() noexcept {
  now_ns_ = parts_.clock.now_ns();
  if (parts_.page != nullptr) parts_.page->guard_beats.fetch_add(1, std::memory_order_relaxed);
  Order order;
  for (int i = 0; parts_.mail != nullptr && i < most_orders_a_look && parts_.mail->next(order); ++i) take(order);
  // Seen before the page is read: if the process has ended, the page is final.
  if (handle_ >= 0 && !gone_) gone_ = parts_.processes.gone(handle_);
  if (pages_) pages_->guard().guardian_beats.fetch_add(1, std::memory_order_relaxed);
  switch (duty_) {
    case Duty::keep: keep(); break;
    case Duty::watch: watch(); break;
    case Duty::act: act(); break;
  }
  if (ending_ && lease_ == 0 && duty_ == Duty::keep) over_ = safe_ || now_ns_ >= ends_at_ns_;
}

void BoardGuard::end() noexcept {
  ending_ = true;
  ends_at_ns_ = parts_.clock.now_ns() + last_tries_ns;
  take_back(Reason::guardian_told_to_end);
  next_keep_ns_ = 0;
}

void BoardGuard::lost_talker() noexcept {
  orphaned_ = lease_ != 0;
  if (orphaned_ && duty_ == Duty::keep) end_lease();
}

void BoardGuard::take(const Order& order) noexcept {
  const bool of_holder = lease_ != 0 && order.lease == lease_;
  switch (order.word) {
    case OrderWord::grant: return grant(order);
    case OrderWord::look:
      if (duty_ == Duty::keep && lease_ == 0 && looked_ns_ != now_ns_) look_at_board();  // once a pass
      return tell(NewsWord::looked);
    case OrderWord::take_back: return take_back(order.reason);
    case OrderWord::close:
      if (of_holder) take_back(Reason::lease_closed);
      return;
    case OrderWord::cover:
      if (!of_holder || duty_ != Duty::keep || taken_back_for_ != Reason::none) return tell(NewsWord::refused);
      cover(std::min(order.timeout_ns, parts_.timeout_ns));
      return tell(NewsWord::covered);
  }
}

void BoardGuard::grant(const Order& order) noexcept {
  if (lease_ != 0 || duty_ != Duty::keep || ending_) return tell(NewsWord::refused, Refusal::held);
  look_at_board();
  // A datagram that is lost is no board that cannot be made safe.
  for (int more = 0; more < 2 && board_.error == driver::IoError::no_answer; ++more) look_at_board();
  if (!former_gone()) return tell(NewsWord::refused, Refusal::former_lives);
  if (!board_.ok()) return tell(NewsWord::refused, Refusal::not_safe);
  const int handle = parts_.processes.open(order.pid);
  if (handle < 0) return tell(NewsWord::refused, Refusal::cannot_end_it);
  try {
    pages_.emplace();
  } catch (...) {
    parts_.processes.close(handle);
    return tell(NewsWord::refused, Refusal::no_memory);
  }
  const Pages::Descriptors descriptors = pages_->descriptors();
  static_cast<void>(pages_->refuse_further_writers());
  lease_ = ++last_lease_;
  handle_ = handle;
  pid_ = order.pid;
  gone_ = covered_once_ = orphaned_ = false;
  foreign_duties_ = 0;
  report_ = {};
  taken_back_for_ = Reason::none;
  covered_by_ns_ = now_ns_ + cover_within_ns;
  parts_.board.let_go();
  parts_.page->holder.store(pid_, std::memory_order_relaxed);
  tell(NewsWord::granted, Refusal::none, descriptors);
}

void BoardGuard::cover(std::int64_t timeout_ns) noexcept {
  duty_ = Duty::watch;
  covered_once_ = true;
  timeout_ns_ = timeout_ns;
  look_period_ns_ = look_period_for(timeout_ns);
  watchdog_.emplace(timeout_ns, look_period_ns_, parts_.board.owner_needs_ns());
  report_ = {};
  looks_until_believed_ = looks_to_believe;
  blind_since_ns_ = -1;
  foreign_duties_ = 0;
  now_ns_ = last_look_ns_ = parts_.clock.now_ns();
  next_keep_ns_ = now_ns_ + takes_over_within_ns;
  suspensions_.begin(parts_.clock);
  if (parts_.mail != nullptr) parts_.board.let_go();  // the owner of the other kind has its board already
  if (parts_.page != nullptr) parts_.page->run_needs_ns.store(timeout_ns, std::memory_order_relaxed);
  pages_->guard().covers.fetch_add(1, std::memory_order_release);
}

/// A run that is covered gets a mark, and the time to make its outputs safe itself. Any other lease ends at once.
void BoardGuard::take_back(Reason reason) noexcept {
  if (duty_ == Duty::watch) {
    if (taken_back_for_ == Reason::none) taken_back_for_ = reason;
  } else if (duty_ == Duty::keep && lease_ != 0) {
    end_lease();
  }
}

void BoardGuard::tell(NewsWord word, Refusal why, const Pages::Descriptors& pages) noexcept {
  if (parts_.mail == nullptr) return;
  parts_.mail->tell({.word = word,
                     .lease = lease_,
                     .why = why,
                     .safe = safe_,
                     .former_pid = former_handle_ >= 0 ? former_pid_ : 0,
                     .board = board_,
                     .report = word == NewsWord::acted ? report_ : GuardianReport{}},
                    pages);
}

void BoardGuard::keep() noexcept {
  if (lease_ != 0 && gone_) end_lease();
  if (lease_ != 0 && !covered_once_ && now_ns_ >= covered_by_ns_) end_holder(Refusal::too_late);
  // A holder has a board of one owner open: nobody else can write to it, and it can be seen only when it is back.
  const bool may_look = lease_ == 0 || parts_.board.works_beside_owner();
  if (may_look && now_ns_ >= next_keep_ns_) look_at_board();
  if (lease_ != 0 && foreign_duties_ >= foreign_duties_most) end_holder(Refusal::not_safe);
  if (!board_.ok() && former_handle_ >= 0 && now_ns_ >= end_former_at_ns_) parts_.processes.end(former_handle_);
  next_ns_ = std::max(next_keep_ns_, now_ns_ + quick_pause_ns);
}

/// The only thing that may wait: the standby is told.
driver::IoResult BoardGuard::access(bool only_look) noexcept {
  if (parts_.page != nullptr) parts_.page->accesses_board.store(true, std::memory_order_relaxed);
  const driver::IoResult result = only_look ? parts_.board.verify_safe() : parts_.board.make_safe();
  if (parts_.page != nullptr) parts_.page->accesses_board.store(false, std::memory_order_relaxed);
  return result;
}

void BoardGuard::look_at_board() noexcept {
  const driver::IoError before = board_.error;
  looked_ns_ = now_ns_;
  board_ = access(board_.ok());
  const bool foreign = board_.error == driver::IoError::foreign_writer;
  foreign_duties_ =
      foreign ? std::min(foreign_duties_ + foreign_duty_weighs, foreign_duties_most) : std::max(0, foreign_duties_ - 1);
  if (foreign) {
    foreign_looks_ =
        now_ns_ - foreign_seen_ns_ > foreign_forgotten_ns ? 1 : std::min(foreign_looks_ + 1, foreign_looks_most);
    foreign_seen_ns_ = now_ns_;
  }
  safe_ = board_.ok() && former_gone();
  next_keep_ns_ = now_ns_ + (foreign || foreign_duties_ > 0 ? quick_pause_ns
                             : board_.ok()                  ? parts_.keep_ns
                                                            : slow_pause_ns);
  if (board_.error != before) tell(NewsWord::board);
}

bool BoardGuard::former_gone() noexcept {
  if (former_handle_ < 0) return true;
  if (!parts_.processes.gone(former_handle_)) return false;
  parts_.processes.close(std::exchange(former_handle_, -1));
  return true;
}

void BoardGuard::end_holder(Refusal why) noexcept {
  parts_.processes.end(handle_);
  end_lease(why);
}

/// The outputs are the guard's again. Whoever had them must have let go of the board, or be gone, before the next
/// lease.
void BoardGuard::end_lease(Refusal why) noexcept {
  pages_->guard().taken_back_for.store(Reason::lease_closed, std::memory_order_relaxed);
  former_handle_ = std::exchange(handle_, -1);
  former_pid_ = pid_;
  end_former_at_ns_ = now_ns_ + frees_board_within_ns;
  parts_.page->holder.store(0, std::memory_order_relaxed);
  parts_.board.take_hold();
  board_ = {driver::IoError::not_active};  // an owner had it: make it safe, then look
  look_at_board();
  // A process that was not ended may live on: it has no lease, its page carries the mark, and its board is zero.
  const bool may_live = why == Refusal::none && !report_.ended_controller && board_.ok();
  if (may_live && former_handle_ >= 0) parts_.processes.close(std::exchange(former_handle_, -1));
  safe_ = board_.ok() && former_gone();
  tell(NewsWord::over, why);
  lease_ = 0;
  pages_.reset();
}

Reason BoardGuard::must_give_back_for(Stage stage) noexcept {
  const std::int64_t gap_ns = now_ns_ - std::exchange(last_look_ns_, now_ns_);
  const std::int64_t suspended_ns = suspensions_.look(parts_.clock);
  const Reason marked = pages_->guard().taken_back_for.load(std::memory_order_relaxed);
  const bool may_drive =
      stage != Stage::released && stage != Stage::handed_over && stage != Stage::closed && stage != Stage::resting;
  if (!may_drive) return marked;
  if (taken_back_for_ == Reason::none && suspended_ns > 0) taken_back_for_ = Reason::computer_suspended;
  // The controller's own limit is one timeout, or three of its periods.
  if (taken_back_for_ == Reason::none && gap_ns > 2 * timeout_ns_) taken_back_for_ = Reason::guardian_paused;
  pages_->guard().taken_back_for.store(taken_back_for_, std::memory_order_relaxed);
  return taken_back_for_;
}

void BoardGuard::watch() noexcept {
  next_ns_ = now_ns_ + look_period_ns_;
  const RunPage& run = pages_->run();
  HeartbeatReading reading{.now_ns = now_ns_, .controller_gone = gone_};
  reading.stage = run.stage.load(std::memory_order_acquire);
  reading.cycle_beats =
      run.cycle_beats.load(std::memory_order_relaxed) + run.safe_beats.load(std::memory_order_relaxed);
  reading.taken_back_for = must_give_back_for(reading.stage);
  const Verdict verdict = watchdog_->look(reading);
  report_ = {.reason = watchdog_->reason(), .silence_ns = watchdog_->silence_ns(), .noticed_ns = now_ns_};
  if (gone_) report_.controller_gone_ns = now_ns_;
  const bool released = reading.stage == Stage::released;
  if (verdict == Verdict::make_safe) return begin_to_act(released || reading.stage == Stage::handed_over);
  // A run that has released its outputs need not be asked for them.
  if (verdict == Verdict::dismissed || (released && taken_back_for_ != Reason::none)) return dismiss();
  if (released && parts_.board.works_beside_owner()) static_cast<void>(believe_once_seen());
  if (!released && reading.cycle_beats == 0 && parts_.board.tells_duties()) look_before_first_cycle();
}

/// No run drives its board before its first cycle: what is on until then is somebody else's.
void BoardGuard::look_before_first_cycle() noexcept {
  if (now_ns_ < next_keep_ns_) return;
  board_ = {};  // only looks: the run has taken its outputs over
  look_at_board();
  next_ns_ = std::min(next_ns_, next_keep_ns_);
  if (foreign_duties_ < foreign_duties_most) return;
  report_.reason = Reason::foreign_writer;
  begin_to_act(false);
}

/// Looks whether the outputs are zero, as the run says. Returns true once that was seen often enough. A run whose board
/// shows an output is ended. Of a board that shows nothing the guard takes over the outputs and lets the run end.
bool BoardGuard::believe_once_seen() noexcept {
  const bool must_wait_for_owner = !gone_ && !parts_.board.works_beside_owner();
  const bool rests = pages_->run().stage.load(std::memory_order_relaxed) == Stage::resting;
  if (must_wait_for_owner && rests) return true;  // an access would disturb its driver
  const bool first = looks_until_believed_ == looks_to_believe;
  if ((!first || blind_since_ns_ >= 0) && now_ns_ < next_keep_ns_) return false;
  if (first) board_ = {driver::IoError::not_active};  // make it safe, then look
  const bool only_looks = board_.ok();  // zeros that the guard writes itself prove nothing but that they can be written
  look_at_board();
  next_ns_ = std::min(next_ns_, next_keep_ns_);
  const bool shows_output =
      board_.error == driver::IoError::read_back_mismatch || board_.error == driver::IoError::foreign_writer;
  const bool blind = !board_.ok() && !shows_output && !must_wait_for_owner;
  if (!blind) blind_since_ns_ = -1;
  if (blind && blind_since_ns_ < 0) blind_since_ns_ = now_ns_;
  const bool blind_too_long = blind && now_ns_ - blind_since_ns_ >= blind_most_ns;
  const bool lies = (first && shows_output && !must_wait_for_owner) || foreign_duties_ >= foreign_duties_most;
  if (lies || blind_too_long) {
    report_.reason = Reason::safe_state_unverified;
    begin_to_act(!lies);
    return false;
  }
  if (board_.ok() && (first || only_looks)) looks_until_believed_ = std::max(0, looks_until_believed_ - 1);
  if (!board_.ok() && must_wait_for_owner) looks_until_believed_ = 0;  // its owner has it still: looked at afterwards
  return looks_until_believed_ == 0;
}

/// The run says that it is done with safe outputs.
void BoardGuard::dismiss() noexcept {
  if (!believe_once_seen()) return;
  pages_->guard().ended_safe.store(true, std::memory_order_relaxed);
  pages_->guard().ends.fetch_add(1, std::memory_order_release);
  duty_ = Duty::keep;
  if (parts_.mail == nullptr) over_ = true;
  if (report_.reason != Reason::none) tell(NewsWord::acted);  // it died after it had released its outputs
  tell(NewsWord::ended);
  if (orphaned_ || (parts_.mail != nullptr && taken_back_for_ != Reason::none)) end_lease();
}

void BoardGuard::begin_to_act(bool writes_zeros_only) noexcept {
  duty_ = Duty::act;
  report_.acted = true;
  report_.controller_lives = writes_zeros_only && !gone_;
  report_.ended_controller = !report_.controller_lives && !gone_;
  if (report_.controller_lives) pages_->guard().taken_back_for.store(report_.reason, std::memory_order_relaxed);
  if (parts_.released != nullptr) parts_.released->store(false, std::memory_order_relaxed);
  if (report_.ended_controller) parts_.processes.end(handle_);
  safe_ = false;
  acts_since_ns_ = next_try_ns_ = now_ns_;
  gone_by_ns_ = now_ns_ + end_wait_ns;
  confirmed_ = 0;
  act();
}

void BoardGuard::act() noexcept {
  gone_ = gone_ || parts_.processes.gone(handle_);
  const bool may_be_undone = !gone_ && !report_.controller_lives;
  if (gone_ && !report_.controller_lives && report_.controller_gone_ns == 0) {
    report_.controller_gone_ns = parts_.clock.now_ns();
  }
  constexpr std::int64_t look_for_end_ns = 100'000;
  if ((may_be_undone && now_ns_ < gone_by_ns_) || now_ns_ < next_try_ns_) {
    next_ns_ = may_be_undone ? now_ns_ + look_for_end_ns : next_try_ns_;
    return;
  }
  board_ = access(confirmed_ > 0);
  ++report_.tries;
  const std::int64_t written_ns = parts_.clock.now_ns();
  if (report_.tries == 1) report_.first_written_ns = written_ns;
  if (!board_.ok()) report_.last_error = board_;
  if (report_.controller_lives && board_.error == driver::IoError::foreign_writer) {
    // It promised to write zeros only.
    parts_.processes.end(handle_);
    report_.controller_lives = false;
    report_.ended_controller = true;
  }
  confirmed_ = board_.ok() ? confirmed_ + 1 : 0;
  report_.verified = !may_be_undone && confirmed_ >= (report_.controller_lives ? looks_to_believe : 1);
  if (report_.verified) report_.verified_ns = written_ns;
  const std::int64_t pause_ns = confirmed_ > 0                ? std::max(parts_.keep_ns, quick_pause_ns)
                                : report_.tries < quick_tries ? quick_pause_ns
                                                              : slow_pause_ns;
  next_ns_ = next_try_ns_ = written_ns + pause_ns;
  if (!report_.verified && !must_give_up()) return;

  safe_ = report_.verified;
  pages_->guard().ended_safe.store(safe_, std::memory_order_relaxed);
  pages_->guard().ends.fetch_add(1, std::memory_order_release);
  tell(NewsWord::acted);
  duty_ = Duty::keep;
  if (parts_.mail == nullptr) {
    over_ = true;
  } else {
    end_lease();
  }
}

/// The resident guard goes on for ever, but not with this lease: its report must not wait for a board that is gone.
bool BoardGuard::must_give_up() noexcept {
  constexpr std::int64_t first_tries_ns = 200'000'000;
  const std::int64_t tried_ns = parts_.clock.now_ns() - acts_since_ns_;
  if (parts_.mail != nullptr) return tried_ns >= first_tries_ns;
  report_.released = parts_.released != nullptr && parts_.released->load(std::memory_order_relaxed);
  return report_.released || (parts_.insist_ns > 0 && tried_ns >= parts_.insist_ns);
}

}  // namespace abs_hil::guardian
