#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "driver/factory.hpp"

namespace abs_hil::guardian {

/// The files of the board that the options name, as `owners_of` takes them. Looks for the board on this computer.
[[nodiscard]] std::vector<std::string> files_of_board(const driver::DriverOptions& options);

/// A process that has a board open.
struct BoardOwner {
  pid_t pid{0};
  std::string name{};
  std::size_t board{0};  ///< which one
  bool ended{false};
  bool killed{false};  ///< with SIGKILL
};

/// The processes that have one of the files of a board open, as far as this user may see them. Without this process,
/// and without guardians and `abs_hil safe`, which write zeros only. Opens no file of theirs, asks no file system about
/// one, and reads nothing for which a process would have to be responsive.
/// @param files  of each board; "udp:" and a peer as /proc/net/udp names it: the sockets that are connected to it
[[nodiscard]] std::vector<BoardOwner> owners_of(const std::vector<std::vector<std::string>>& files);

/// Ends processes that drive boards, all at once, and waits for their ends, at most 2.5 s. Each is asked to stop in
/// order and killed if it is stopped, still lives after a second, or must not be waited for.
/// @param must_go  tells whether that board's owner must be killed now; `asked_ns` is when it was asked (monotonic)
void end_owners(std::vector<BoardOwner>& owners,
                const std::function<bool(std::size_t board, std::int64_t asked_ns)>& must_go);

/// Ends those who drive a board without a cover, as `abs_hil safe` does. They are asked first, but not for long.
/// Returns what it did, a sentence each.
/// @param files  of the board @param holder  has a right to have it open: others are suspected first
std::vector<std::string> end_unguarded(const std::vector<std::string>& files, pid_t holder);

}  // namespace abs_hil::guardian
