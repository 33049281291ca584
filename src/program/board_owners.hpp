#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace abs_hil::program {

/// A process that has a board open.
struct BoardOwner {
  pid_t pid{0};
  std::string name{};
};

/// The processes that have one of these files open, as far as this user may see them. Without this process, and without
/// guardians, which write zeros only.
[[nodiscard]] std::vector<BoardOwner> owners_of(const std::vector<std::string>& files);

/// Ends a process that drives a board: asks it twice to stop in order, then kills it. Waits for its end, at most about
/// two seconds. False if it lives on or may not be ended.
[[nodiscard]] bool end_owner(const BoardOwner& owner);

}  // namespace abs_hil::program
