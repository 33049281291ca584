#pragma once

#include <libusb.h>

#include <cstdint>
#include <deque>
#include <vector>

namespace abs_hil::test {

/// Replacement for libusb in a program linked with libusb_stand_in.cpp, whose functions replace the library's. It has
/// one device with a queue per endpoint. The test sets the results of the calls and reads their arguments.
struct LibusbStandIn {
  /// One alternate setting: the interface's number, its own, its endpoints with their attributes.
  struct Setting {
    std::uint8_t number{0};
    std::uint8_t alternate{0};
    std::vector<libusb_endpoint_descriptor> endpoints{};
  };

  // Results of the calls: 0 or LIBUSB_ERROR_...
  int init_error{0};
  int wrap_error{0};
  int config_error{0};
  int claim_error{0};
  int setting_error{0};
  int submit_error{0};
  std::vector<Setting> settings{};
  /// Whether transfers to the board finish.
  bool takes{true};
  libusb_transfer_status out_status{LIBUSB_TRANSFER_COMPLETED};
  libusb_transfer_status in_status{LIBUSB_TRANSFER_COMPLETED};
  /// Answers waiting in the board, one per transfer.
  std::deque<std::vector<std::uint8_t>> answers{};
  std::int64_t board_time_ns{0};
  /// Result of a control transfer instead of its size; 0: its size.
  int control_result{0};

  // What was asked.
  std::vector<std::vector<std::uint8_t>> sent{};  ///< to the board, in order, once it has taken them
  std::vector<int> claimed{};
  std::vector<int> chosen_settings{};
  std::vector<unsigned> cleared_halts{};
  int open_contexts{0};
  int open_handles{0};
  int transfers{0};
  int configs{0};
  std::deque<libusb_transfer*> under_way{};
  std::deque<libusb_transfer*> cancelled{};
};

/// The stand-in that the functions use; each test begins with a new one.
LibusbStandIn& libusb_stand_in();

}  // namespace abs_hil::test
