#pragma once

#include <sched.h>
#include <sys/resource.h>

namespace abs_hil::program {

/// Gives this process precedence over ordinary work and over every run. Without the right to it nothing happens.
inline void take_first_place() noexcept {
  constexpr int most_nice = -20;
  sched_param wanted{};
  wanted.sched_priority = ::sched_get_priority_max(SCHED_FIFO) - 1;
  if (::sched_setscheduler(0, SCHED_FIFO, &wanted) != 0) {
    static_cast<void>(::setpriority(PRIO_PROCESS, 0, most_nice));
  }
}

}  // namespace abs_hil::program
