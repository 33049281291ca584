// A stand-in for the kernel's usbfs, with queues and a clock of its own.
#include "usbfs_stand_in.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "catch.hpp"

namespace abs_hil::test {

namespace {

constexpr int only_file = 7;

bool is_in(const usbdevfs_urb& urb) { return (urb.endpoint & 0x80U) != 0; }

}  // namespace

std::vector<std::uint8_t> UsbfsStandIn::descriptors_of(std::uint8_t configuration,
                                                       const std::vector<Setting>& settings) {
  std::vector<std::uint8_t> all;
  const auto add = [&all](std::initializer_list<std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) all.push_back(byte);
  };
  add({18, 1, 0, 2, 0xFF, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1});
  add({9, 2, 0, 0, 1, configuration, 0, 0x80, 50});
  for (const Setting& s : settings) {
    add({9, 4, s.number, s.alternate, static_cast<std::uint8_t>(s.endpoints.size()), 0xFF, 0, 0, 0});
    for (const Endpoint& e : s.endpoints) add({7, 5, e.address, e.attributes, 0x00, 0x02, 0});
  }
  return all;
}

int UsbfsStandIn::open(const char* /*node*/) noexcept {
  if (open_error != 0) return open_error;
  ++open_files;
  read_bytes_ = 0;
  return only_file;
}

void UsbfsStandIn::close(int file) noexcept {
  CHECK(file == only_file);
  --open_files;
  claimed.clear();
  under_way.clear();
  ended_.clear();
}

std::int64_t UsbfsStandIn::read(int file, std::span<std::uint8_t> bytes) noexcept {
  CHECK(file == only_file);
  if (read_error != 0) return read_error;
  constexpr std::size_t most = 20;  // a short read is nothing special
  const std::size_t count = std::min({bytes.size(), most, descriptors.size() - read_bytes_});
  std::copy_n(descriptors.begin() + static_cast<std::ptrdiff_t>(read_bytes_), count, bytes.begin());
  read_bytes_ += count;
  return static_cast<std::int64_t>(count);
}

int UsbfsStandIn::ioctl(int file, unsigned long request, void* argument) noexcept {
  CHECK(file == only_file);
  if (request == USBDEVFS_REAPURBNDELAY) return reap(*static_cast<usbdevfs_urb**>(argument));
  if (unplugged_) return -ENODEV;
  switch (request) {
    case USBDEVFS_CLAIMINTERFACE:
      if (claim_error != 0) return claim_error;
      claimed.push_back(*static_cast<unsigned*>(argument));
      return 0;
    case USBDEVFS_SETINTERFACE: {
      const auto& setting = *static_cast<usbdevfs_setinterface*>(argument);
      CHECK(claimed == std::vector{setting.interface});
      chosen_settings.push_back(setting.altsetting);
      return setting_error;
    }
    case USBDEVFS_SUBMITURB: return submit(static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_DISCARDURB: return discard(static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_CLEAR_HALT: cleared_halts.push_back(*static_cast<unsigned*>(argument)); return 0;
    case USBDEVFS_CONTROL: return control(*static_cast<usbdevfs_ctrltransfer*>(argument));
    default: return -ENOTTY;
  }
}

int UsbfsStandIn::submit(usbdevfs_urb* urb) {
  ++submissions;
  if (submit_error != 0) return submit_error;
  CHECK(urb->type == USBDEVFS_URB_TYPE_BULK);
  CHECK(urb->flags == 0);
  CHECK(urb->signr == 0);
  CHECK_FALSE(claimed.empty());
  const auto same = [urb](const Transfer& transfer) { return transfer.urb == urb; };
  CHECK(std::none_of(under_way.begin(), under_way.end(), same));
  CHECK(std::none_of(ended_.begin(), ended_.end(), same));
  const auto* data = static_cast<const std::uint8_t*>(urb->buffer);
  under_way.push_back({.urb = urb});
  if (!is_in(*urb)) under_way.back().bytes.assign(data, data + urb->buffer_length);
  return 0;
}

int UsbfsStandIn::discard(const usbdevfs_urb* urb) {
  if (discard_error != 0) return discard_error;
  const auto found =
      std::find_if(under_way.begin(), under_way.end(), [urb](const Transfer& transfer) { return transfer.urb == urb; });
  if (found == under_way.end()) return -EINVAL;
  end(found, -ENOENT);
  return 0;
}

void UsbfsStandIn::end(std::deque<Transfer>::iterator transfer, int status) {
  transfer->status = status;
  if (status != 0) transfer->bytes.clear();
  ended_.push_back(std::move(*transfer));
  under_way.erase(transfer);
}

void UsbfsStandIn::settle() {
  if (unplugged_) return;
  for (;;) {
    const auto ready = std::find_if(under_way.begin(), under_way.end(), [this](const Transfer& transfer) {
      return is_in(*transfer.urb) ? !answers.empty() || in_status != 0 : takes;
    });
    if (ready == under_way.end()) return;
    if (!is_in(*ready->urb)) {
      if (out_status == 0) sent.push_back(ready->bytes);
      end(ready, out_status);
    } else {
      if (in_status == 0) {
        ready->bytes = std::move(answers.front());
        answers.pop_front();
      }
      end(ready, in_status);
    }
  }
}

int UsbfsStandIn::reap(usbdevfs_urb*& urb) {
  ++reaps;
  settle();
  if (ended_.empty()) return unplugged_ ? -ENODEV : -EAGAIN;
  const Transfer transfer = std::move(ended_.front());
  ended_.pop_front();
  urb = transfer.urb;
  urb->status = transfer.status;
  urb->actual_length = static_cast<int>(transfer.bytes.size());
  if (is_in(*urb)) {
    CHECK(urb->actual_length <= urb->buffer_length);
    std::copy(transfer.bytes.begin(), transfer.bytes.end(), static_cast<std::uint8_t*>(urb->buffer));
  }
  return 0;
}

void UsbfsStandIn::wait(int file, std::int64_t timeout_ns) noexcept {
  CHECK(file == only_file);
  CHECK(timeout_ns > 0);
  ++waits;
  settle();
  if (!ended_.empty() || unplugged_) return;
  time_ns += waiting ? waiting(timeout_ns) : timeout_ns;
}

void UsbfsStandIn::unplug(bool transfers_end) {
  unplugged_ = true;
  while (transfers_end && !under_way.empty()) end(under_way.begin(), -ESHUTDOWN);
}

int UsbfsStandIn::control(const usbdevfs_ctrltransfer& transfer) {
  CHECK(transfer.bRequest == 0x54);
  CHECK(transfer.wLength == sizeof board_time_ns);
  if (control_result != 0) return control_result;
  if (transfer.bRequestType == 0xC0) {  // from the device, the vendor's
    std::memcpy(transfer.data, &board_time_ns, sizeof board_time_ns);
  } else {
    CHECK(transfer.bRequestType == 0x40);
    std::memcpy(&board_time_ns, transfer.data, sizeof board_time_ns);
  }
  return transfer.wLength;
}

}  // namespace abs_hil::test
