#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/rig/command.hpp"
#include "driver/factory.hpp"

namespace abs_hil::program {

/// A board that is to be made safe.
struct Target {
  std::string what{};
  std::vector<std::string> files{};
  driver::DriverOptions options{};
  std::string known_as{};  ///< its names for the resident service, one a line
};

/// What a board's thread has seen so far. Times are of CLOCK_MONOTONIC; 0: never.
struct Seen {
  Target target{};
  int tries{0};
  std::int64_t zero_ns{0};                     ///< end of the first try that got its zeros to the board
  bool reached{false};                         ///< the last try did
  std::string problem{"it has not answered"};  ///< of the last try; empty if it verified the zeros
  std::optional<rig::Command> before{};        ///< the outputs that this try found
  std::int64_t on_ns{0};                       ///< when a try last found an output on
  int quiet_tries{0};  ///< tries since `count_anew` that verified the zeros and found nothing on, unbroken
};

/// Writes zeros to boards, again and again, with a thread for each board and for each search for boards: one that hangs
/// holds up neither the others nor the caller. The threads never end a wait for a board by themselves, so a program
/// that leaves before they have ended must leave with _Exit.
class ZeroWriting {
 public:
  using Find = std::function<std::vector<Target>()>;

  ZeroWriting();
  /// Begins to search. Each board found gets its zeros from that moment on. A board that is known already is left out.
  void search(Find find);
  /// Waits until all searches are over and each board has been tried once, at most `most_ms`.
  void wait_for_first_tries(int most_ms) const;
  [[nodiscard]] std::vector<Seen> seen() const;
  /// Why searches failed.
  [[nodiscard]] std::vector<std::string> problems() const;
  /// Quiet tries count from 0 again, from the next try on.
  void count_anew();
  /// Ends the writing. Returns true if all threads have ended within `most_ms`.
  [[nodiscard]] bool end(int most_ms);

 private:
  struct State;
  static void write_zeros(const std::shared_ptr<State>& state, std::size_t board);
  static void add(const std::shared_ptr<State>& state, Target target);

  std::shared_ptr<State> state_;
};

}  // namespace abs_hil::program
