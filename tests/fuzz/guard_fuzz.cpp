// A guard whose run's page, orders, processes, clock and board do anything: it neither crashes nor leaves an output on.
#include <cstdint>
#include <vector>

#include "../guardian/scripted_parts.hpp"
#include "fuzz_input.hpp"
#include "guardian/board_guard.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using namespace abs_hil::fuzz;

constexpr int hostile = 7;  ///< the process that gets leases

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  Story story;
  ScriptedClock clock;
  ScriptedProcesses processes(clock, story);
  ScriptedBoard board(story);
  Mail mail;
  ServicePage page;
  BoardGuard guard({.clock = clock,
                    .board = board,
                    .processes = processes,
                    .timeout_ns = 20 * ms,
                    .keep_ns = 5 * ms,
                    .mail = &mail,
                    .page = &page});
  guard.begin();
  std::optional<Pages> pages;
  std::int64_t on_since_ns = -1;
  const auto look = [&] {
    const bool fails = board.fails_first > 0;
    guard.look();
    News news;
    std::vector<driver::FileDescriptor> page_files;
    while (mail.next(news, page_files)) {
      if (news.word == NewsWord::granted)
        pages.emplace(Pages::as_run({page_files.at(0).get(), page_files.at(1).get()}));
      page_files.clear();
    }
    clock.sleep_until(std::max(guard.next_ns(), clock.now_ns() + 100 * us));
    story.clear();
    // Without a lease a duty is gone at the second look at a board that answers, whatever else happens.
    const bool alone = board.duty != 0.0 && page.holder.load() == 0 && !fails;
    if (!alone) on_since_ns = -1;
    if (alone && on_since_ns < 0) on_since_ns = clock.now_ns();
    expect(!alone || clock.now_ns() - on_since_ns <= 20 * ms);
  };
  while (!input.empty()) {
    const std::uint8_t what = input.byte();
    const std::uint8_t value = input.byte();
    switch (what % 10) {
      case 0:
      case 1:
        static_cast<void>(mail.order({.word = static_cast<OrderWord>(value % 7),
                                      .lease = value / 8U,
                                      .pid = hostile,
                                      .reason = static_cast<rig::Reason>(value),
                                      .timeout_ns = value * ms / 4}));
        break;
      case 2:
        if (pages) pages->run().cycle_beats.store(value);
        break;
      case 3:
        if (pages) pages->run().stage.store(static_cast<Stage>(value % 7));
        break;
      case 4:
        if (processes.lives(hostile)) board.duty = value / 255.0;
        break;
      case 5: clock.jump(value * ms); break;
      case 6: clock.suspend(value % 4 * ms); break;
      case 7: board.fails_first = value % 8; break;
      case 8:
        if (value < 32) processes.dies_at_ns[hostile] = clock.now_ns();
        break;
      default: board.shared = value % 2 == 0; break;
    }
    look();
  }
  // Left alone, and with a board that answers, it brings every output to zero: at the latest when a first beat is due.
  board.fails_first = 0;
  const std::int64_t until_ns = clock.now_ns() + Watchdog::first_beat_ns + 2'000 * ms;
  while (clock.now_ns() < until_ns) look();
  // The limit that docs/safety.md names: nobody sees what the owner of a board of one owner writes while no run of it
  // is covered, or once it has said that its outputs are released. When it is gone, they are zero.
  const bool has_board = !board.shared && page.holder.load() != 0;
  const bool covered = pages && pages->guard().covers.load() > pages->guard().ends.load();
  expect(board.duty == 0.0 || (has_board && (!covered || pages->run().stage.load() == Stage::released)));
  if (has_board) {
    processes.dies_at_ns[hostile] = clock.now_ns();
    clock.jump(1 * ms);
    for (int n = 0; n < 1000 && board.duty != 0.0; ++n) look();
    expect(board.duty == 0.0);
  }
  guard.end();
  for (int n = 0; n < 1000 && !guard.over(); ++n) look();
  expect(guard.over() && board.duty == 0.0);
  return 0;
}
