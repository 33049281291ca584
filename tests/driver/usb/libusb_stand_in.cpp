#include "libusb_stand_in.hpp"

#include <algorithm>
#include <cstring>

namespace abs_hil::test {

namespace {

/// A configuration in libusb's own structures, alive until it is freed.
struct Configuration {
  explicit Configuration(const std::vector<LibusbStandIn::Setting>& from) : settings(from) {
    descriptors.resize(settings.size());
    interfaces.resize(settings.size());
    for (std::size_t i = 0; i < settings.size(); ++i) {
      descriptors[i].bInterfaceNumber = settings[i].number;
      descriptors[i].bAlternateSetting = settings[i].alternate;
      descriptors[i].bNumEndpoints = static_cast<std::uint8_t>(settings[i].endpoints.size());
      descriptors[i].endpoint = settings[i].endpoints.data();
      interfaces[i] = {.altsetting = &descriptors[i], .num_altsetting = 1};
    }
    whole.bNumInterfaces = static_cast<std::uint8_t>(interfaces.size());
    whole.interface = interfaces.data();
  }
  std::vector<LibusbStandIn::Setting> settings;
  std::vector<libusb_interface_descriptor> descriptors{};
  std::vector<libusb_interface> interfaces{};
  libusb_config_descriptor whole{};
};

/// libusb's handles are of types that nobody outside sees: any address serves.
template <typename Handle>
Handle* token() {
  static char place;
  return reinterpret_cast<Handle*>(&place);
}

Configuration*& configuration() {
  static Configuration* current = nullptr;
  return current;
}

void finish(libusb_transfer* transfer, libusb_transfer_status status, std::size_t bytes) {
  transfer->status = status;
  transfer->actual_length = static_cast<int>(bytes);
  transfer->callback(transfer);
}

/// One that can be finished now, or none.
libusb_transfer* take_ready(LibusbStandIn& usb) {
  const auto ready = std::find_if(usb.under_way.begin(), usb.under_way.end(), [&](const libusb_transfer* transfer) {
    if ((transfer->endpoint & LIBUSB_ENDPOINT_IN) == 0) return usb.takes;
    return !usb.answers.empty() || usb.in_status != LIBUSB_TRANSFER_COMPLETED;
  });
  if (ready == usb.under_way.end()) return nullptr;
  libusb_transfer* transfer = *ready;
  usb.under_way.erase(ready);
  return transfer;
}

void finish_with_board(LibusbStandIn& usb, libusb_transfer* transfer) {
  if ((transfer->endpoint & LIBUSB_ENDPOINT_IN) == 0) {
    const auto length = static_cast<std::size_t>(transfer->length);
    if (usb.out_status == LIBUSB_TRANSFER_COMPLETED) {
      usb.sent.emplace_back(transfer->buffer, transfer->buffer + length);
    }
    finish(transfer, usb.out_status, length);
    return;
  }
  std::size_t bytes = 0;
  if (usb.in_status == LIBUSB_TRANSFER_COMPLETED) {
    bytes = std::min(usb.answers.front().size(), static_cast<std::size_t>(transfer->length));
    std::copy_n(usb.answers.front().begin(), bytes, transfer->buffer);  // an answer may be empty
    usb.answers.pop_front();
  }
  finish(transfer, usb.in_status, bytes);
}

}  // namespace

LibusbStandIn& libusb_stand_in() {
  static LibusbStandIn instance;
  return instance;
}

}  // namespace abs_hil::test

using abs_hil::test::Configuration;
using abs_hil::test::configuration;
using abs_hil::test::libusb_stand_in;
using abs_hil::test::token;

extern "C" {

int libusb_set_option(libusb_context* /*context*/, enum libusb_option /*option*/, ...) { return 0; }

int libusb_init(libusb_context** context) {
  if (libusb_stand_in().init_error != 0) return libusb_stand_in().init_error;
  ++libusb_stand_in().open_contexts;
  *context = token<libusb_context>();
  return 0;
}
void libusb_exit(libusb_context* /*context*/) { --libusb_stand_in().open_contexts; }

int libusb_wrap_sys_device(libusb_context* /*context*/, std::intptr_t /*file*/, libusb_device_handle** handle) {
  if (libusb_stand_in().wrap_error != 0) return libusb_stand_in().wrap_error;
  ++libusb_stand_in().open_handles;
  *handle = token<libusb_device_handle>();
  return 0;
}
void libusb_close(libusb_device_handle* /*handle*/) { --libusb_stand_in().open_handles; }
libusb_device* libusb_get_device(libusb_device_handle* /*handle*/) { return token<libusb_device>(); }

int libusb_get_active_config_descriptor(libusb_device* /*device*/, libusb_config_descriptor** config) {
  if (libusb_stand_in().config_error != 0) return libusb_stand_in().config_error;
  ++libusb_stand_in().configs;
  configuration() = new Configuration(libusb_stand_in().settings);
  *config = &configuration()->whole;
  return 0;
}
void libusb_free_config_descriptor(libusb_config_descriptor* /*config*/) {
  --libusb_stand_in().configs;
  delete configuration();
  configuration() = nullptr;
}

int libusb_claim_interface(libusb_device_handle* /*handle*/, int number) {
  if (libusb_stand_in().claim_error != 0) return libusb_stand_in().claim_error;
  libusb_stand_in().claimed.push_back(number);
  return 0;
}
int libusb_release_interface(libusb_device_handle* /*handle*/, int number) {
  return std::erase(libusb_stand_in().claimed, number) == 1 ? 0 : LIBUSB_ERROR_NOT_FOUND;
}
int libusb_set_interface_alt_setting(libusb_device_handle* /*handle*/, int /*number*/, int setting) {
  libusb_stand_in().chosen_settings.push_back(setting);
  return libusb_stand_in().setting_error;
}

libusb_transfer* libusb_alloc_transfer(int /*iso_packets*/) {
  ++libusb_stand_in().transfers;
  return new libusb_transfer{};
}
void libusb_free_transfer(libusb_transfer* transfer) {
  --libusb_stand_in().transfers;
  delete transfer;
}
int libusb_submit_transfer(libusb_transfer* transfer) {
  if (libusb_stand_in().submit_error != 0) return libusb_stand_in().submit_error;
  libusb_stand_in().under_way.push_back(transfer);
  return 0;
}
int libusb_cancel_transfer(libusb_transfer* transfer) {
  auto& usb = libusb_stand_in();
  if (std::erase(usb.under_way, transfer) == 0) return LIBUSB_ERROR_NOT_FOUND;
  usb.cancelled.push_back(transfer);
  return 0;
}
int libusb_clear_halt(libusb_device_handle* /*handle*/, unsigned char endpoint) {
  libusb_stand_in().cleared_halts.push_back(endpoint);
  return 0;
}
int libusb_handle_events_timeout_completed(libusb_context* /*context*/, timeval* /*timeout*/, int* /*completed*/) {
  auto& usb = libusb_stand_in();
  for (; !usb.cancelled.empty(); usb.cancelled.pop_front()) {
    abs_hil::test::finish(usb.cancelled.front(), LIBUSB_TRANSFER_CANCELLED, 0);
  }
  while (libusb_transfer* transfer = abs_hil::test::take_ready(usb)) abs_hil::test::finish_with_board(usb, transfer);
  return 0;
}

int libusb_control_transfer(libusb_device_handle* /*handle*/, std::uint8_t kind, std::uint8_t /*request*/,
                            std::uint16_t /*value*/, std::uint16_t /*index*/, unsigned char* data, std::uint16_t size,
                            unsigned /*timeout_ms*/) {
  auto& usb = libusb_stand_in();
  if (usb.control_result != 0) return usb.control_result;
  if ((kind & LIBUSB_ENDPOINT_IN) != 0) {
    std::memcpy(data, &usb.board_time_ns, size);
  } else {
    std::memcpy(&usb.board_time_ns, data, size);
  }
  return size;
}

}  // extern "C"
