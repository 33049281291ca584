// Makes an RT-DAC/USB2 safe from a second process, after its owner's end.
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

void UsbSafeState::opened() noexcept {
  shown_ = false;
  frame_ = blank_frame();
}

bool UsbSafeState::show(Frame& words) noexcept {
  std::span<const std::uint8_t> bytes;
  if (!handle_.link->answer_outstanding() && !handle_.link->request().ok()) return false;
  if (!handle_.link->receive(answer_ns, bytes).ok() || bytes.size() != frame_bytes) return false;
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
  const IoResult sent = handle_.link->send(frame_);
  return sent.ok() ? handle_.link->flush(taken_ns) : sent;
}

IoResult UsbSafeState::verify(std::int64_t timeout_ns) noexcept {
  if (!options_.verify_outputs) return {};
  std::span<const std::uint8_t> bytes;
  if (const IoResult came = fresh_answer(*handle_.link, timeout_ns, bytes); !came.ok()) return came;
  Contents contents;
  if (const IoError error = decode(bytes, options_, contents); error != IoError::none) return {error, endpoint_in};
  return shows(contents, zeros_, options_) ? IoResult{} : IoResult{IoError::read_back_mismatch, endpoint_in};
}

IoResult UsbSafeState::look() noexcept {
  if (!shown_ || !options_.verify_outputs) return {IoError::no_answer, endpoint_in};
  const IoResult seen = verify(look_ns);
  return seen.error == IoError::read_back_mismatch ? foreign_output(seen.where) : seen;
}

IoResult UsbSafeState::write_zeros() noexcept {
  if (!shown_) learn_words();
  IoResult result = send_zeros();
  if (result.ok()) result = verify(taken_ns);
  if (result.ok() || result.error == IoError::disconnected) return result;
  handle_.link->recover();
  static_cast<void>(send_zeros());  // the next call verifies
  return result;
}

}  // namespace abs_hil::driver::usb
