#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "interchange/foreign_code.hpp"

namespace abs_hil::interchange {

/// Serves foreign code to the process at the other end of `host_socket` until that closes it. Returns the exit status.
/// @param make  loads the code, in a process that is confined by then
/// @param allocations  calls of malloc and its like in this process so far
int run_host(const std::function<std::unique_ptr<ForeignCode>(const ForeignSetup&)>& make,
             const std::function<std::uint64_t()>& allocations);

}  // namespace abs_hil::interchange
