// Writes zeros to all boards at once, each from a thread of its own, so that none waits for another.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "abs_hil/rig/command.hpp"
#include "driver/factory.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::program {

/// A board that is to be made safe.
struct Target {
  std::string what{};
  std::vector<std::string> files{};
  driver::DriverOptions options{};
  std::string known_as{};  ///< its names for the resident service, one a line
};

/// What a board's thread has seen so far. Times are of CLOCK_MONOTONIC; 0: never.
struct Seen {
  Target target{};
  int tries{0};
  std::int64_t zero_ns{0};                     ///< end of the first try that got its zeros to the board
  bool reached{false};                         ///< the last try did
  std::string problem{"it has not answered"};  ///< of the last try; empty if it verified the zeros
  std::optional<rig::Command> before{};        ///< the outputs that this try found
  std::int64_t on_ns{0};                       ///< when a try last found an output on
  int quiet_tries{0};  ///< tries since `count_anew` that verified the zeros and found nothing on, unbroken
};

/// A live owner writes every ms or so. More often than this would only keep the board from it and from its guardian.
inline constexpr std::chrono::milliseconds zeros_pause{2};

/// Zeros that cannot be read back did go out.
[[nodiscard]] inline bool has_reached(const driver::IoResult& result) {
  return result.ok() || result.error == driver::IoError::read_back_mismatch ||
         result.error == driver::IoError::no_answer;
}

/// The same board, whether the options name its address or not.
[[nodiscard]] inline bool is_same(const Target& a, const Target& b) {
  return a.known_as.substr(0, a.known_as.find('\n')) == b.known_as.substr(0, b.known_as.find('\n'));
}

/// Writes zeros to boards, again and again, with a thread for each board and for each search for boards: one that hangs
/// holds up neither the others nor the caller. The threads never end a wait for a board by themselves, so a program
/// that leaves before they have ended must leave with _Exit.
class ZeroWriting {
 public:
  using Find = std::function<std::vector<Target>()>;

  /// Begins to search. Each board found gets its zeros from that moment on. A board that is known already is left out.
  void search(Find find) {
    const std::lock_guard lock(state_->mutex);
    ++state_->searches;
    state_->begin(state_, [state = state_, find = std::move(find)] {
      std::string problem;
      try {
        std::vector<Target> found = find();
        for (Target& target : found) add(state, std::move(target));
      } catch (const std::exception& error) {
        problem = error.what();
      }
      const std::lock_guard done(state->mutex);
      if (!problem.empty()) state->problems.push_back(std::move(problem));
      --state->searches;
      state->changed.notify_all();
    });
  }
  /// Waits until all searches are over and each board has been tried once, at most `most_ms`.
  void wait_for_first_tries(int most_ms) const {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait_for(lock, std::chrono::milliseconds(most_ms), [this] {
      return state_->searches == 0 &&
             std::ranges::all_of(state_->boards, [](const Seen& seen) { return seen.tries > 0; });
    });
  }
  [[nodiscard]] std::vector<Seen> seen() const {
    const std::lock_guard lock(state_->mutex);
    return state_->boards;
  }
  /// Why searches failed.
  [[nodiscard]] std::vector<std::string> problems() const {
    const std::lock_guard lock(state_->mutex);
    return state_->problems;
  }
  /// Quiet tries count from 0 again, from the next try on.
  void count_anew() {
    const std::lock_guard lock(state_->mutex);
    state_->counts_from_ns = driver::monotonic_ns();
    for (Seen& seen : state_->boards) seen.quiet_tries = 0;
  }
  /// Ends the writing. Returns true if all threads have ended within `most_ms`.
  [[nodiscard]] bool end(int most_ms) {
    std::unique_lock lock(state_->mutex);
    state_->ending = true;
    state_->changed.notify_all();
    return state_->changed.wait_for(lock, std::chrono::milliseconds(most_ms), [this] { return state_->threads == 0; });
  }

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::vector<Seen> boards;
    std::vector<std::string> problems;  ///< of searches
    int searches{0};
    int threads{0};
    std::int64_t counts_from_ns{0};
    bool ending{false};

    void begin(const std::shared_ptr<State>& self, std::function<void()> work) {
      ++threads;
      std::thread([self, work = std::move(work)] {
        work();
        const std::lock_guard lock(self->mutex);
        --self->threads;
        self->changed.notify_all();
      }).detach();
    }
  };

  static void write_zeros(const std::shared_ptr<State>& state, std::size_t board) {
    std::unique_lock lock(state->mutex);
    const driver::DriverOptions options = state->boards[board].target.options;
    std::unique_ptr<driver::SafeStateWriter> writer;
    bool opened = false;
    while (!state->ending) {
      lock.unlock();
      const std::int64_t begin_ns = driver::monotonic_ns();
      driver::IoResult result{driver::IoError::disconnected};
      std::string problem;
      try {
        if (!writer) writer = driver::make_safe_state_writer(options, true);
        // Zeros first: a board that cannot be identified, or hardly, takes them all the same.
        result = writer->make_safe();
        if (!result.ok()) problem = driver::error_text(result);
        if (!opened && !has_reached(result)) {
          auto again = driver::make_safe_state_writer(options, true);
          again->prepare();  // says why it cannot be opened
          writer = std::move(again);
        }
        opened = true;
      } catch (const std::exception& error) {
        problem = error.what();
      }
      const std::optional<rig::Command> found = writer ? writer->found() : std::nullopt;
      const bool on = found && rig::acts(*found);
      lock.lock();
      Seen& seen = state->boards[board];
      seen.reached = has_reached(result);
      if (seen.reached && seen.zero_ns == 0) {
        seen.zero_ns = driver::monotonic_ns();
        seen.before = found;
      }
      ++seen.tries;
      if (on) seen.on_ns = driver::monotonic_ns();
      seen.quiet_tries = result.ok() && !on && begin_ns >= state->counts_from_ns ? seen.quiet_tries + 1 : 0;
      seen.problem = std::move(problem);
      state->changed.notify_all();
      state->changed.wait_for(lock, zeros_pause, [&] { return state->ending; });
    }
  }
  static void add(const std::shared_ptr<State>& state, Target target) {
    const std::lock_guard lock(state->mutex);
    if (std::ranges::any_of(state->boards, [&](const Seen& seen) { return is_same(seen.target, target); })) return;
    state->boards.push_back({.target = std::move(target)});
    state->begin(state, [state, board = state->boards.size() - 1] { write_zeros(state, board); });
  }

  std::shared_ptr<State> state_{std::make_shared<State>()};
};

}  // namespace abs_hil::program
