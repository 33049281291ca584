#pragma once

#include <cstdint>

namespace abs_hil::interchange {

struct TrappedSystemCalls {
  std::uint64_t count{0};
  std::int32_t first{-1};  ///< number of the first one
};

/// From now on this process may only send on `socket`, ask for memory, and end. Any other system call is counted and
/// fails with ENOSYS. False if the kernel cannot do that.
[[nodiscard]] bool trap_system_calls(int socket);
[[nodiscard]] TrappedSystemCalls trapped_system_calls() noexcept;

}  // namespace abs_hil::interchange
