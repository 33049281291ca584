#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "driver/hm2/hm2_driver.hpp"
#include "driver/own_handle_writer.hpp"

namespace abs_hil::driver::hm2 {

/// Drops all outputs of a HostMot2 board from a second process, through a socket of its own: one datagram `PWM 0,
/// enable 0, watchdog bites now`, then a look whether the direction of all pins is 0. The board answers to each sender,
/// so it works beside the owner; but an owner takes its datagrams for another program's.
class Hm2SafeState final : public SafeStateWriter {
 public:
  /// @param open_link  throws Unavailable
  Hm2SafeState(const Hm2Options& options, OpenLink open_link);

  [[nodiscard]] std::string_view name() const noexcept override { return "hm2"; }
  /// Reads the board's descriptors.
  void prepare() override;
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return hm2_make_safe_bound_ns; }
  [[nodiscard]] bool works_beside_owner() const noexcept override { return true; }
  [[nodiscard]] IoResult make_safe() noexcept override;
  /// Reads the direction of all pins; while all are inputs nothing is driven.
  [[nodiscard]] IoResult verify_safe() noexcept override;

 private:
  /// Where the board has what is written: as all known firmware has it, until its descriptors have been read.
  void learn(const Board& board) noexcept;
  void identify(Link& link);
  [[nodiscard]] bool find_board() noexcept;
  [[nodiscard]] IoResult look(std::int64_t wait_ns) noexcept;

  Hm2Options options_;
  OpenLink open_link_;
  std::unique_ptr<Link> link_{};
  int socket_error_{0};  ///< why there is no link
  bool known_{false};    ///< its descriptors have been read
  bool tried_{false};    ///< to identify it
  int silent_looks_{0};  ///< in a row
  Reopening again_{};
  std::uint32_t number_{0};
  std::uint16_t direction_{0};
  unsigned ports_{0};
  Packet zeros_{};
};

}  // namespace abs_hil::driver::hm2
