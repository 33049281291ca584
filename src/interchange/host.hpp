#pragma once

#include <cstdint>
#include <functional>

namespace abs_hil::interchange {

/// Serves foreign code to the process at the other end of `host_socket` until that closes it. Returns the exit status.
/// @param allocations  calls of malloc and its like in this process so far
int run_host(const std::function<std::uint64_t()>& allocations);

}  // namespace abs_hil::interchange
