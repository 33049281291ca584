#include "guardian/guard.hpp"

#include "abs_hil/driver/io_result.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

void refuse_run(const std::string& what) {
  throw driver::Unavailable("guardian: " + what +
                            ". The run does not start without a guardian: if this program died, nothing would stop the "
                            "motor (docs/dead-man.md)");
}

void Guard::making_safe() noexcept {
  pages().run().stage.store(Stage::making_safe, std::memory_order_release);
  // A failed write and the end of the run each make the outputs safe, without a cycle in between. Each beat restarts
  // the guardian's timeout.
  pages().run().safe_beats.fetch_add(1, std::memory_order_relaxed);
}

void Guard::outputs_released(bool safe) noexcept {
  pages().run().stage.store(safe ? Stage::released : Stage::handed_over, std::memory_order_release);
}

void Guard::reset_page() noexcept {
  RunPage& page = pages().run();
  page.cycle_beats.store(0, std::memory_order_relaxed);
  page.safe_beats.store(0, std::memory_order_relaxed);
  page.stage.store(Stage::guarded, std::memory_order_release);
}

bool Guard::close_page(Stage stage) noexcept {
  std::atomic<Stage>& now = pages().run().stage;
  // `handed_over` must stay: a delayed guardian has to read it, however late.
  const bool handed_over = now.load(std::memory_order_acquire) == Stage::handed_over;
  if (!handed_over) now.store(stage, std::memory_order_release);
  return handed_over;
}

void Guard::refuse_weaker(const runtime::Scheduling& guardian, const runtime::Scheduling& controller,
                          const std::string& program) {
  if (guardian.at_least(controller)) return;
  const auto in_words = [](const runtime::Scheduling& s) {
    const std::string policy = s.fifo_priority > 0 ? rig::formatted("SCHED_FIFO %d", s.fifo_priority) : "no SCHED_FIFO";
    return policy + (s.memory_locked ? ", locked memory" : ", no locked memory");
  };
  refuse_run("it has " + in_words(guardian) + ", but the controller has " + in_words(controller) +
             ": a controller in an endless loop would keep it from the processor. Give " + program +
             " the rights of abs_hil (the limits of docs/real-time.md, or sudo setcap cap_sys_nice,cap_ipc_lock+ep " +
             program + "), or set a lower realtime.priority");
}

}  // namespace abs_hil::guardian
