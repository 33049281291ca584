#pragma once

#include <utility>

#include "driver/board_options.hpp"
#include "driver/own_handle_writer.hpp"
#include "driver/usb/frame.hpp"
#include "driver/usb/urb_link.hpp"

namespace abs_hil::driver::usb {

/// Writes the safe state of an RT-DAC/USB2 after its owner's end; only one process can claim the board. It sends zeros
/// whether or not the board answers, and verifies them afterwards. A frame sets all words of the board: those that are
/// not of the rig come from a frame that the board has shown. If it shows none, its digital lines become inputs.
class UsbSafeState final : public OwnHandleWriter<Board> {
 public:
  UsbSafeState(UsbOptions options, Open open_board)
      : OwnHandleWriter(std::move(open_board)), options_(std::move(options)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "usb"; }
  /// Opens nothing: the owner has claimed the board.
  void prepare() override {}
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override;
  void let_go() noexcept override { handle_ = {}; }

 private:
  void opened() noexcept override;
  [[nodiscard]] IoResult write_zeros() noexcept override;
  /// Asks for one frame, at most 5 ms long. It shows the outputs only with driver.usb.verify_outputs.
  [[nodiscard]] IoResult look() noexcept override;
  void learn_words() noexcept;
  /// Asks for a frame and takes its words over; false without one.
  [[nodiscard]] bool show(Frame& words) noexcept;
  [[nodiscard]] IoResult send_zeros() noexcept;
  /// `read_back_mismatch`: a frame shows other outputs than zeros.
  [[nodiscard]] IoResult verify(std::int64_t timeout_ns) noexcept;

  UsbOptions options_;
  Frame frame_{};      ///< the frame to send; all words but the outputs'
  bool shown_{false};  ///< they come from the board
  OutputWords zeros_{};
};

}  // namespace abs_hil::driver::usb
