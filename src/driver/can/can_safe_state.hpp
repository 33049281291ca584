#pragma once

#include <cstdint>
#include <utility>

#include "driver/can/bus.hpp"
#include "driver/own_handle_writer.hpp"

namespace abs_hil::driver::can {

/// Writes the safe state of a CAN node: it sends the request to deactivate, and zeros, without any handshake, and waits
/// afterwards until the node reports that it is inactive with both outputs 0. A bus takes more than one socket, so this
/// one is open beside the owner's. An emulator's socket takes one peer only, so it is opened after the owner's end.
class CanSafeState final : public OwnHandleWriter<Link> {
 public:
  /// @param open_link  does not wait
  /// @param one_peer   the link takes one peer only
  CanSafeState(Open open_link, bool one_peer) : OwnHandleWriter(std::move(open_link)), one_peer_(one_peer) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "can"; }
  void prepare() override {
    if (!one_peer_) open_now();
  }
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override;
  void let_go() noexcept override {
    if (one_peer_) handle_ = {};
  }

 private:
  [[nodiscard]] IoResult write_zeros() noexcept override;
  /// One SYNC and its answer, at most 5 ms long. The answer tells that the node is inactive, which keeps its outputs 0;
  /// an answer with applied duties, on classic CAN every tenth, tells these as well. `foreign_writer` if any frame
  /// shows a node that is not inactive, or duties, or is a command.
  [[nodiscard]] IoResult look() noexcept override;
  [[nodiscard]] IoResult send_zeros() noexcept;
  /// Waits until the node reports the safe state.
  [[nodiscard]] IoResult verify() noexcept;

  bool one_peer_;
  std::uint8_t sync_{0};
};

}  // namespace abs_hil::driver::can
