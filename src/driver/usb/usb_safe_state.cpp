// Makes an RT-DAC/USB2 safe from a second process, after its owner's end.
#include <utility>

#include "driver/own_handle_writer.hpp"
#include "driver/usb/usb_driver.hpp"

namespace abs_hil::driver::usb {

namespace {

/// A healthy board answers within a millisecond. Zeros wait no longer for its words.
constexpr std::int64_t answer_ns = 20'000'000;
/// It is called again until it succeeds: a single call need not be as patient as the owner's last one.
constexpr std::int64_t taken_ns = 100'000'000;
constexpr std::int64_t look_ns = 5'000'000;

/// All lines are inputs, all outputs 0.
Frame blank_frame() noexcept {
  Frame shown{};
  for (std::size_t i = 0; i < 2; ++i) put_payload(shown, word::digital_direction + i, payload_bits);
  return frame_from(shown);
}

class UsbSafeState final : public OwnHandleWriter<Board> {
 public:
  UsbSafeState(const UsbOptions& options, Open open_board)
      : OwnHandleWriter(std::move(open_board)), options_(options) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "usb"; }
  /// Opens nothing: the owner has claimed the board.
  void prepare() override {}
  [[nodiscard]] std::int64_t owner_needs_ns() const noexcept override { return usb_make_safe_bound_ns; }
  void let_go() noexcept override { handle_ = {}; }

 private:
  void opened() noexcept override {
    shown_ = false;
    frame_ = blank_frame();
  }
  [[nodiscard]] IoResult write_zeros() noexcept override {
    if (!shown_) learn_words();
    IoResult result = send_zeros();
    if (result.ok()) result = verify(taken_ns);
    if (result.ok() || result.error == IoError::disconnected) return result;
    handle_.link->recover();
    static_cast<void>(send_zeros());  // the next call verifies
    return result;
  }
  /// Asks for one frame, at most 5 ms long. It shows the outputs only with driver.usb.verify_outputs.
  [[nodiscard]] IoResult look() noexcept override {
    if (!shown_ || !options_.verify_outputs) return {IoError::no_answer, endpoint_in};
    const IoResult seen = verify(look_ns);
    return seen.error == IoError::read_back_mismatch ? foreign_output(seen.where) : seen;
  }
  void learn_words() noexcept {
    // Garbage is not the same twice.
    Frame first{};
    Frame second{};
    if (!show(first) || !show(second) || first != second) return;
    frame_ = second;
    shown_ = true;
  }
  /// Asks for a frame and takes its words over; false without one.
  [[nodiscard]] bool show(Frame& words) noexcept {
    std::span<const std::uint8_t> bytes;
    if (!handle_.link->answer_outstanding() && !handle_.link->request().ok()) return false;
    if (!handle_.link->receive(answer_ns, bytes).ok() || bytes.size() != frame_bytes) return false;
    words = frame_from(bytes.first<frame_bytes>());
    return true;
  }
  [[nodiscard]] IoResult send_zeros() noexcept {
    zeros_ = put_outputs(frame_, options_, 0, 0, false);
    const IoResult sent = handle_.link->send(frame_);
    return sent.ok() ? handle_.link->flush(taken_ns) : sent;
  }
  /// `read_back_mismatch`: a frame shows other outputs than zeros.
  [[nodiscard]] IoResult verify(std::int64_t timeout_ns) noexcept {
    if (!options_.verify_outputs) return {};
    std::span<const std::uint8_t> bytes;
    if (const IoResult came = fresh_answer(*handle_.link, timeout_ns, bytes); !came.ok()) return came;
    Contents contents;
    if (const IoError error = decode(bytes, options_, contents); error != IoError::none) return {error, endpoint_in};
    return shows(contents, zeros_, options_) ? IoResult{} : IoResult{IoError::read_back_mismatch, endpoint_in};
  }

  UsbOptions options_;
  Frame frame_{};      ///< the frame to send; all words but the outputs'
  bool shown_{false};  ///< they come from the board
  OutputWords zeros_{};
};

}  // namespace

std::unique_ptr<SafeStateWriter> safe_state_writer(const UsbOptions& options, OpenBoard open_board) {
  return std::make_unique<UsbSafeState>(options, std::move(open_board));
}

}  // namespace abs_hil::driver::usb
