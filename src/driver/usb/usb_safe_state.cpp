#include "driver/usb/usb_safe_state.hpp"

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

}  // namespace

std::int64_t UsbSafeState::owner_needs_ns() const noexcept { return usb_make_safe_bound_ns; }

IoResult UsbSafeState::open() noexcept {
  try {
    board_ = open_board_();
    if (!board_.link) return {IoError::disconnected};
    shown_ = false;
    frame_ = blank_frame();
    return {};
  } catch (...) {
    board_ = {};
    return {IoError::disconnected};
  }
}

bool UsbSafeState::show(Frame& words) noexcept {
  std::span<const std::uint8_t> bytes;
  if (!board_.link->answer_outstanding() && !board_.link->request().ok()) return false;
  if (!board_.link->receive(answer_ns, bytes).ok() || bytes.size() != frame_bytes) return false;
  words = frame_from(bytes.first<frame_bytes>());
  return true;
}

void UsbSafeState::learn_words() noexcept {
  // Garbage is not the same twice.
  Frame first{};
  Frame second{};
  if (!show(first) || !show(second) || first != second) return;
  frame_ = second;
  shown_ = true;
}

IoResult UsbSafeState::send_zeros() noexcept {
  zeros_ = put_outputs(frame_, options_, 0, 0, false);
  const IoResult sent = board_.link->send(frame_);
  return sent.ok() ? board_.link->flush(taken_ns) : sent;
}

IoResult UsbSafeState::verify(std::int64_t timeout_ns) noexcept {
  if (!options_.verify_outputs) return {};
  // An answer that was asked for before the zeros shows the outputs of that moment.
  std::span<const std::uint8_t> bytes;
  if (board_.link->answer_outstanding()) {
    if (const IoResult late = board_.link->receive(timeout_ns, bytes); !late.ok()) return late;
  }
  if (const IoResult asked = board_.link->request(); !asked.ok()) return asked;
  if (const IoResult came = board_.link->receive(timeout_ns, bytes); !came.ok()) return came;
  Contents contents;
  if (const IoError error = decode(bytes, options_, contents); error != IoError::none) return {error, endpoint_in};
  return shows(contents, zeros_, options_) ? IoResult{} : IoResult{IoError::read_back_mismatch, endpoint_in};
}

IoResult UsbSafeState::verify_safe() noexcept {
  if (!board_.link || !shown_ || !options_.verify_outputs) return make_safe();
  const IoResult look = verify(look_ns);
  if (look.ok()) return look;
  const IoResult made_safe = make_safe();
  const bool foreign = look.error == IoError::read_back_mismatch;
  return foreign ? IoResult{IoError::foreign_writer, look.where, 0, rig::Reason::foreign_writer} : made_safe;
}

IoResult UsbSafeState::make_safe() noexcept {
  if (!board_.link) {
    if (const IoResult opened = open(); !opened.ok()) return opened;
  }
  if (!shown_) learn_words();
  IoResult result = send_zeros();
  if (result.ok()) result = verify(taken_ns);
  if (result.ok()) return result;
  if (result.error == IoError::disconnected) {
    board_ = {};
  } else {
    board_.link->recover();
    static_cast<void>(send_zeros());  // the next call verifies
  }
  return result;
}

}  // namespace abs_hil::driver::usb
