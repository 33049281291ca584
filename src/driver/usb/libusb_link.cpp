#include "driver/usb/libusb_link.hpp"

#include <fcntl.h>
#include <libusb.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <string>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::usb {

namespace {

constexpr std::int64_t give_up_ns = rig::ns_per_s;

[[noreturn]] void refuse(const UsbDevice& device, const std::string& what) {
  throw Unavailable("backend rig: USB board " + device.text() + ": " + what);
}

FileDescriptor open_node(const UsbDevice& device) {
  const int fd = ::open(device.node.c_str(), O_RDWR | O_CLOEXEC);
  if (fd >= 0) return FileDescriptor(fd);
  const int error = errno;
  std::string what = device.node.string() + ": " + std::strerror(error);
  if (error == EACCES || error == EPERM) {
    what += ". Put this line into /etc/udev/rules.d/70-abs-hil.rules and plug the board in again (docs/usb.md):\n" +
            udev_rule(device);
  }
  refuse(device, what);
}

IoResult from_status(int status, std::uint8_t endpoint) noexcept {
  switch (status) {
    case LIBUSB_TRANSFER_COMPLETED: return {};
    case LIBUSB_TRANSFER_STALL: return {IoError::stalled, endpoint, EPIPE};
    case LIBUSB_TRANSFER_NO_DEVICE: return {IoError::disconnected, endpoint, ENODEV};
    case LIBUSB_TRANSFER_OVERFLOW: return {IoError::incomplete_answer, endpoint, EOVERFLOW};
    case LIBUSB_TRANSFER_CANCELLED: return {IoError::no_answer, endpoint};
    default: return {IoError::transfer_failed, endpoint};
  }
}

IoResult from_error(int error, std::uint8_t endpoint) noexcept {
  switch (error) {
    case LIBUSB_SUCCESS: return {};
    case LIBUSB_ERROR_NO_DEVICE: return {IoError::disconnected, endpoint, ENODEV};
    case LIBUSB_ERROR_PIPE: return {IoError::stalled, endpoint, EPIPE};
    case LIBUSB_ERROR_TIMEOUT:
    case LIBUSB_ERROR_BUSY: return {IoError::no_answer, endpoint};
    default: return {IoError::transfer_failed, endpoint};
  }
}

/// Finds the interface and alternate setting with both bulk endpoints; false if there is none.
bool find_interface(const libusb_config_descriptor& config, int& number, int& setting) {
  for (const libusb_interface& interface : std::span(config.interface, config.bNumInterfaces)) {
    for (const libusb_interface_descriptor& alternate :
         std::span(interface.altsetting, static_cast<std::size_t>(interface.num_altsetting))) {
      int found = 0;
      for (const libusb_endpoint_descriptor& e : std::span(alternate.endpoint, alternate.bNumEndpoints)) {
        const bool bulk = (e.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) == LIBUSB_TRANSFER_TYPE_BULK;
        if (bulk && (e.bEndpointAddress == endpoint_out || e.bEndpointAddress == endpoint_in)) ++found;
      }
      if (found != 2) continue;
      number = alternate.bInterfaceNumber;
      setting = alternate.bAlternateSetting;
      return true;
    }
  }
  return false;
}

// Control requests that only the emulator has.
constexpr std::uint8_t request_emulated_time = 0x54;
constexpr std::uint8_t vendor_out = LIBUSB_REQUEST_TYPE_VENDOR;
constexpr std::uint8_t vendor_in = vendor_out | 0x80U;
constexpr unsigned control_timeout_ms = 10'000;

}  // namespace

LibusbLink::LibusbLink(const UsbDevice& device) : node_(open_node(device)) {
  // The device is already known: libusb must not scan all buses or start its hot-plug thread.
  libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
  if (const int error = libusb_init(&context_); error != 0) {
    refuse(device, std::string("libusb cannot start: ") + libusb_strerror(static_cast<libusb_error>(error)));
  }
  try {
    claim(device);
  } catch (...) {
    if (handle_ != nullptr) libusb_close(handle_);
    libusb_exit(context_);
    throw;
  }
  for (Slot* slot : {&frames_[0], &frames_[1], &frames_[2], &request_, &answer_}) {
    slot->transfer = libusb_alloc_transfer(0);
    const std::uint8_t endpoint = slot == &answer_ ? endpoint_in : endpoint_out;
    libusb_fill_bulk_transfer(slot->transfer, handle_, endpoint, slot->buffer.data(), 0, on_done, slot, 0);
  }
  std::copy(frame_request.begin(), frame_request.end(), request_.buffer.begin());
}

void LibusbLink::claim(const UsbDevice& device) {
  const auto check = [&device](int error, const std::string& what) {
    if (error != 0) refuse(device, what + ": " + libusb_strerror(static_cast<libusb_error>(error)));
  };
  check(libusb_wrap_sys_device(context_, node_.get(), &handle_), "cannot be opened");
  libusb_config_descriptor* config = nullptr;
  check(libusb_get_active_config_descriptor(libusb_get_device(handle_), &config), "has no configuration");
  int setting = 0;
  const bool found = find_interface(*config, interface_, setting);
  libusb_free_config_descriptor(config);
  if (!found) {
    refuse(
        device,
        "has no interface with bulk endpoints 02 (out) and 84 (in): it is another device, or its firmware is missing");
  }
  const int claimed = libusb_claim_interface(handle_, interface_);
  if (claimed == LIBUSB_ERROR_BUSY) {
    interface_ = -1;
    refuse(device, "is in use by another process; a board has only one owner: end that process first");
  }
  check(claimed, "cannot be claimed");
  if (setting != 0)
    check(libusb_set_interface_alt_setting(handle_, interface_, setting), "does not accept its alternate setting");
}

LibusbLink::~LibusbLink() {
  cancel_all();
  for (Slot* slot : {&frames_[0], &frames_[1], &frames_[2], &request_, &answer_}) {
    // Transfers that libusb has still not returned cannot be freed.
    if (slot->done != 0) libusb_free_transfer(slot->transfer);
  }
  libusb_release_interface(handle_, interface_);
  libusb_close(handle_);
  libusb_exit(context_);
}

void LibusbLink::on_done(libusb_transfer* transfer) {
  Slot& slot = *static_cast<Slot*>(transfer->user_data);
  slot.status = transfer->status;
  slot.length = transfer->actual_length;
  slot.done = 1;
}

void LibusbLink::handle_events(std::int64_t timeout_ns, int* completed) noexcept {
  timeval timeout{.tv_sec = timeout_ns / rig::ns_per_s, .tv_usec = timeout_ns % rig::ns_per_s / 1000};
  libusb_handle_events_timeout_completed(context_, &timeout, completed);
}

IoResult LibusbLink::submit(Slot& slot, std::size_t bytes) noexcept {
  slot.transfer->length = static_cast<int>(bytes);
  slot.status = LIBUSB_TRANSFER_COMPLETED;
  slot.length = 0;
  slot.done = 0;
  const int error = libusb_submit_transfer(slot.transfer);
  if (error != 0) slot.done = 1;
  return from_error(error, slot.transfer->endpoint);
}

IoResult LibusbLink::take_send_failure() noexcept {
  for (Slot* slot : {&frames_[0], &frames_[1], &frames_[2], &request_}) {
    if (slot->done == 0 || slot->status == LIBUSB_TRANSFER_COMPLETED) continue;
    const IoResult result = from_status(slot->status, endpoint_out);
    slot->status = LIBUSB_TRANSFER_COMPLETED;
    return result;
  }
  return {};
}

IoResult LibusbLink::send(const Frame& frame) noexcept {
  handle_events(0, nullptr);
  if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
  Slot& slot = frames_[next_frame_];
  if (slot.done == 0) return {IoError::no_answer, endpoint_out};
  std::copy(frame.begin(), frame.end(), slot.buffer.begin());
  const IoResult result = submit(slot, frame.size());
  if (result.ok()) next_frame_ = (next_frame_ + 1) % frames_.size();
  return result;
}

IoResult LibusbLink::request() noexcept {
  if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
  if (request_.done == 0 || answer_.done == 0) return {IoError::no_answer, endpoint_out};
  // Submit the receiving transfer first, so that the answer is not lost.
  if (const IoResult result = submit(answer_, answer_.buffer.size()); !result.ok()) return result;
  return submit(request_, frame_request.size());
}

bool LibusbLink::answer_outstanding() const noexcept { return answer_.done == 0; }

IoResult LibusbLink::receive(std::int64_t timeout_ns, std::span<const std::uint8_t>& bytes) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout_ns;
  std::int64_t left_ns = timeout_ns;
  while (answer_.done == 0) {
    handle_events(left_ns > 0 ? left_ns : 0, &answer_.done);
    if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
    left_ns = deadline_ns - monotonic_ns();
    if (left_ns <= 0) break;
  }
  if (answer_.done == 0) return {IoError::no_answer, endpoint_in};
  if (const IoResult result = from_status(answer_.status, endpoint_in); !result.ok()) return result;
  bytes = std::span(answer_.buffer).first(static_cast<std::size_t>(answer_.length));
  return {};
}

void LibusbLink::wait_for(Slot& slot, std::int64_t timeout_ns) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout_ns;
  for (std::int64_t left_ns = timeout_ns; slot.done == 0 && left_ns > 0; left_ns = deadline_ns - monotonic_ns()) {
    handle_events(left_ns, &slot.done);
  }
}

IoResult LibusbLink::flush(std::int64_t timeout_ns) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout_ns;
  for (Slot& slot : frames_) wait_for(slot, deadline_ns - monotonic_ns());
  if (const IoResult failure = take_send_failure(); !failure.ok()) return failure;
  const bool taken = std::all_of(frames_.begin(), frames_.end(), [](const Slot& slot) { return slot.done != 0; });
  return taken ? IoResult{} : IoResult{IoError::no_answer, endpoint_out};
}

void LibusbLink::cancel_all() noexcept {
  const std::array<Slot*, 5> all{&frames_[0], &frames_[1], &frames_[2], &request_, &answer_};
  for (Slot* slot : all) {
    if (slot->done == 0) libusb_cancel_transfer(slot->transfer);
  }
  for (Slot* slot : all) {
    wait_for(*slot, give_up_ns);
    slot->status = LIBUSB_TRANSFER_COMPLETED;
  }
}

void LibusbLink::recover() noexcept {
  cancel_all();
  libusb_clear_halt(handle_, endpoint_out);
  libusb_clear_halt(handle_, endpoint_in);
  // The board may still hold the cancelled answer. Discard it, so that it does not count as the next one.
  constexpr int most_answers = 4;
  constexpr std::int64_t quiet_ns = 20'000'000;
  for (int i = 0; i < most_answers && answer_.done != 0; ++i) {
    if (!submit(answer_, answer_.buffer.size()).ok()) return;
    wait_for(answer_, quiet_ns);
    if (answer_.done != 0) continue;
    libusb_cancel_transfer(answer_.transfer);
    wait_for(answer_, give_up_ns);
    return;
  }
}

IoResult LibusbLink::emulated_time(std::int64_t& time_ns) noexcept {
  std::array<std::uint8_t, sizeof time_ns> bytes{};
  const int got = libusb_control_transfer(handle_, vendor_in, request_emulated_time, 0, 0, bytes.data(), bytes.size(),
                                          control_timeout_ms);
  if (got != static_cast<int>(bytes.size())) return from_error(got < 0 ? got : LIBUSB_ERROR_IO, 0);
  std::memcpy(&time_ns, bytes.data(), bytes.size());
  return {};
}

IoResult LibusbLink::advance_emulated_time(std::int64_t time_ns) noexcept {
  std::array<std::uint8_t, sizeof time_ns> bytes{};
  std::memcpy(bytes.data(), &time_ns, bytes.size());
  const int sent = libusb_control_transfer(handle_, vendor_out, request_emulated_time, 0, 0, bytes.data(), bytes.size(),
                                           control_timeout_ms);
  return sent == static_cast<int>(bytes.size()) ? IoResult{} : from_error(sent < 0 ? sent : LIBUSB_ERROR_IO, 0);
}

namespace {

class LinkTime final : public EmulatedTime {
 public:
  explicit LinkTime(LibusbLink& link) : link_(link) {}
  IoResult now(std::int64_t& time_ns) noexcept override { return link_.emulated_time(time_ns); }
  IoResult advance_to(std::int64_t time_ns) noexcept override { return link_.advance_emulated_time(time_ns); }

 private:
  LibusbLink& link_;
};

}  // namespace

Board open_board(const UsbOptions& options, bool lock_step, bool emulated) {
  const UsbDevice device = choose_board(options, lock_step, emulated);
  auto link = std::make_unique<LibusbLink>(device);
  Board board{.place = device.text()};
  if (lock_step) board.time = std::make_unique<LinkTime>(*link);
  board.link = std::move(link);
  return board;
}

}  // namespace abs_hil::driver::usb
