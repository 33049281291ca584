// The schedules of the model checker in memory_model.hpp.
#include "memory_model.hpp"

namespace abs_hil::runtime::test {

namespace {
constexpr std::size_t stack_bytes = 64 * 1024;
}

std::size_t Explorer::choose(std::size_t count) {
  if (count == 1) return 0;
  if (at_ == choices_.size()) choices_.push_back({0, count});
  return choices_[at_++].taken;
}

void Explorer::enter() {
  Explorer& e = current();
  const std::size_t me = e.running_;
  e.play_->bodies[me]();
  e.finished_[me] = true;
  swapcontext(&e.contexts_[me], &e.scheduler_);
}

void Explorer::run_once(const Play& play) {
  play_ = &play;
  clocks_ = {};
  finished_ = {};
  raced_ = false;
  for (std::size_t t = 0; t < threads; ++t) {
    stacks_[t].resize(stack_bytes);
    getcontext(&contexts_[t]);
    contexts_[t].uc_stack.ss_sp = stacks_[t].data();
    contexts_[t].uc_stack.ss_size = stacks_[t].size();
    contexts_[t].uc_link = nullptr;
    makecontext(&contexts_[t], &Explorer::enter, 0);
  }
  while (!finished_[0] || !finished_[1]) {
    const bool both = !finished_[0] && !finished_[1];
    running_ = both ? choose(2) : (finished_[0] ? 1 : 0);
    swapcontext(&scheduler_, &contexts_[running_]);
  }
  running_ = threads;
}

/// The next combination of choices, depth first; false after the last.
bool Explorer::next_choices() {
  while (!choices_.empty() && choices_.back().taken + 1 == choices_.back().count) choices_.pop_back();
  if (choices_.empty()) return false;
  ++choices_.back().taken;
  return true;
}

Explorer::Verdict Explorer::explore(const std::function<Play()>& make) {
  current_ = this;
  choices_.clear();
  Verdict verdict;
  do {
    at_ = 0;
    const Play play = make();
    run_once(play);
    ++verdict.executions;
    verdict.races += raced_ ? 1 : 0;
    verdict.unsound += play.sound() ? 0 : 1;
  } while (next_choices());
  return verdict;
}

}  // namespace abs_hil::runtime::test
