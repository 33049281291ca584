#include "runtime/scheduling.hpp"

#include <pthread.h>
#include <sched.h>

#include "runtime/memory_locking.hpp"

namespace abs_hil::runtime {

Scheduling scheduling_of_this_thread() {
  int policy = SCHED_OTHER;
  sched_param parameters{};
  const bool known = pthread_getschedparam(pthread_self(), &policy, &parameters) == 0;
  // The flag means that children do not inherit the policy.
  constexpr int reset_on_fork = 0x40000000;
  const bool fifo = known && (policy & ~reset_on_fork) == SCHED_FIFO;
  return {.fifo_priority = fifo ? parameters.sched_priority : 0, .memory_locked = memory_is_locked()};
}

}  // namespace abs_hil::runtime
