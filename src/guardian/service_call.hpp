#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

namespace abs_hil::guardian {

/// What the resident service says to somebody who is no run.
struct ServiceAnswer {
  pid_t service{0};
  bool answered{false};
  bool keeps_it{false};  ///< it keeps the board that the caller named, or named none
  bool safe{false};      ///< outputs zero and verified, and no lease
  std::string text{};    ///< its board, then who has or had the lease; or why there is no answer
};

/// Asks the service at `socket` for its state. Nothing if none listens there. Takes at most 2 s.
[[nodiscard]] std::optional<ServiceAnswer> service_state(const std::string& socket);
/// Has the service end its lease, if there is one, and make the outputs safe. Waits at most 300 ms for its answer: a
/// service that is stopped, or whose queue is full of silent visitors, gives none.
/// @param boards  names of the board (kept_board), one a line; a service of another board does nothing
[[nodiscard]] std::optional<ServiceAnswer> service_makes_safe(const std::string& socket, const std::string& boards);

}  // namespace abs_hil::guardian
