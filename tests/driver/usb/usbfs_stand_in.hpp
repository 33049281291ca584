#pragma once

#include <linux/ioctl.h>
#include <linux/usbdevice_fs.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "driver/usb/wire.hpp"

namespace abs_hil::test {

/// Takes the place of the kernel's usbfs: one device with a queue per endpoint, on a clock that only waiting advances.
/// As in the kernel, a transfer ends by itself but is seen only when it is reaped, and a closed node gives everything
/// back. The test sets the results of the calls and reads their arguments.
class UsbfsStandIn final : public driver::usb::Usbfs {
 public:
  struct Endpoint {
    std::uint8_t address{0};
    std::uint8_t attributes{2};  ///< 2: bulk
  };
  /// One alternate setting: the interface's number, its own, its endpoints.
  struct Setting {
    std::uint8_t number{0};
    std::uint8_t alternate{0};
    std::vector<Endpoint> endpoints{};
  };
  /// The device's descriptor and those of one configuration.
  static std::vector<std::uint8_t> descriptors_of(std::uint8_t configuration, const std::vector<Setting>& settings);

  int open(const char* node) noexcept override;
  void close(int file) noexcept override;
  std::int64_t read(int file, std::span<std::uint8_t> bytes) noexcept override;
  int ioctl(int file, unsigned long request, void* argument) noexcept override;
  void wait(int file, std::int64_t timeout_ns) noexcept override;
  std::int64_t now_ns() noexcept override { return time_ns; }

  /// The cable is pulled. Transfers end at once, or stay where they are as between the kernel's two steps.
  void unplug(bool transfers_end = true);

  // Results of the calls: 0 or -errno.
  int open_error{0};
  int read_error{0};
  int claim_error{0};
  int setting_error{0};
  int submit_error{0};
  int discard_error{0};
  std::vector<std::uint8_t> descriptors{};
  bool takes{true};   ///< whether transfers to the board end
  int out_status{0};  ///< how transfers to the board end
  int in_status{0};   ///< how transfers from the board end; if not 0, without an answer
  /// Answers waiting in the board, one per transfer.
  std::deque<std::vector<std::uint8_t>> answers{};
  std::int64_t board_time_ns{0};
  int control_result{0};  ///< of a control transfer instead of its size; 0: its size
  /// What happens while the link waits; returns for how long it does, ns. By default nothing, for as long as it may.
  std::function<std::int64_t(std::int64_t timeout_ns)> waiting{};

  // What was asked.
  std::vector<std::vector<std::uint8_t>> sent{};  ///< to the board, in order, once it has taken them
  std::vector<unsigned> claimed{};
  std::vector<unsigned> chosen_settings{};
  std::vector<unsigned> cleared_halts{};
  int open_files{0};
  int submissions{0};
  int reaps{0};
  int waits{0};
  std::int64_t time_ns{1'000'000'000};

  struct Transfer {
    usbdevfs_urb* urb{nullptr};
    std::vector<std::uint8_t> bytes{};  ///< to the board: copied when submitted; from it: copied when reaped
    int status{0};
  };
  std::deque<Transfer> under_way{};

 private:
  int submit(usbdevfs_urb* urb);
  int discard(const usbdevfs_urb* urb);
  int reap(usbdevfs_urb*& urb);
  int control(const usbdevfs_ctrltransfer& transfer);
  /// Ends what the board can end now.
  void settle();
  void end(std::deque<Transfer>::iterator transfer, int status);

  std::size_t read_bytes_{0};
  bool unplugged_{false};
  std::deque<Transfer> ended_{};
};

}  // namespace abs_hil::test
