// The guard of the resident service with a talker's side of the mail, for its tests. Mailbox and pages are real.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "catch.hpp"
#include "guardian/board_guard.hpp"
#include "scripted_parts.hpp"

namespace abs_hil::guardian::test {

inline constexpr pid_t run_process = 4711;
inline constexpr pid_t other_process = 815;

/// The guard of a service, and the talker's side of the mail.
struct Service {
  Service() {
    clock.happens = [this](std::int64_t now_ns) {
      if (beats && now_ns % ms == 0) pages->run().cycle_beats.fetch_add(1);
      if (happens) happens(now_ns);
    };
  }
  /// Time in which the guard looks as often as it wants to.
  void pass(std::int64_t duration_ns) {
    for (const std::int64_t end_ns = clock.now_ns() + duration_ns; clock.now_ns() < end_ns;) {
      guard.look();
      ++looks;
      take_news();
      clock.sleep_until(std::min(end_ns, std::max(guard.next_ns(), clock.now_ns() + 100 * us)));
    }
    guard.look();
    take_news();
  }
  void take_news() {
    News one;
    std::vector<driver::FileDescriptor> files;
    while (mail.next(one, files)) {
      news.push_back(one);
      if (one.word == NewsWord::granted) pages.emplace(Pages::as_run({files.at(0).get(), files.at(1).get()}));
      files.clear();
    }
  }
  /// Answers to one order.
  std::vector<News> order(const Order& order) {
    news.clear();
    REQUIRE(mail.order(order));
    guard.look();
    take_news();
    return news;
  }
  News answer(const Order& one) {
    const std::vector<News> all = order(one);
    REQUIRE_FALSE(all.empty());
    return all.back();
  }
  std::uint32_t granted(pid_t pid = run_process) {
    const News said = answer({.word = OrderWord::grant, .pid = pid});
    REQUIRE(said.word == NewsWord::granted);
    return said.lease;
  }
  std::uint32_t covered(pid_t pid = run_process) {
    const std::uint32_t lease = granted(pid);
    REQUIRE(answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
    beats = true;
    return lease;
  }
  [[nodiscard]] const News* said(NewsWord word) const {
    const auto found = std::find_if(news.begin(), news.end(), [&](const News& one) { return one.word == word; });
    return found == news.end() ? nullptr : &*found;
  }
  /// How often the story has `what` from its line `from` on.
  [[nodiscard]] std::int64_t count(const char* what, std::size_t from = 0) const {
    return std::count(story.begin() + static_cast<std::ptrdiff_t>(from), story.end(), what);
  }
  void stage(Stage to) { pages->run().stage = to; }

  Story story;
  ScriptedClock clock;
  ScriptedProcesses processes{clock, story};
  ScriptedBoard board{story};
  Mail mail;
  ServicePage page;
  std::optional<Pages> pages;
  std::vector<News> news;
  std::function<void(std::int64_t)> happens;
  bool beats{false};
  int looks{0};
  BoardGuard guard{resident_guard(clock, board, processes, mail, page)};
};

}  // namespace abs_hil::guardian::test
